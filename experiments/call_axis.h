// The axis `call`: how many rays a kernel gets a call. `batch`: all that there are, as a renderer that has them
// together hands them over; `packet`: one packet of the traversal's width, as a program of lanes does; `ray`: one, as a
// program that follows one path at a time. The calls are those of the library's Tracer (library/arboretum.h), so a way
// of traversal is measured under another's interface, and what the interface itself costs with it.
#pragma once

#include <array>
#include <cstddef>
#include <string>
#include <string_view>

#include "experiments/cell.h"

namespace arboretum {

/// `batch` first: the default, which cell names do not tell.
inline constexpr std::array<std::string_view, 3> kCalls{"batch", "packet", "ray"};

/// Rays of one call of the cell's kernel; 0: all.
[[nodiscard]] std::size_t rays_a_call(const Cell& cell);

/// One line: why the cell's kernel is not called so. Empty where it is.
[[nodiscard]] std::string why_no_call(const Cell& cell);

}  // namespace arboretum
