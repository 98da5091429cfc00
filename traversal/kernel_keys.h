// What keys that stand for others mean: `auto` (also for none at all), `packet` and `hybrid`. The library, `render`,
// `verify` and the plans of sweeps resolve them here, so that a key means the same wherever it is written.
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "core/isa.h"
#include "traversal/kernel_table.h"

namespace arboretum {

/// Stands for the value that follows from the others.
inline constexpr std::string_view kAuto = "auto";
[[nodiscard]] constexpr bool is_auto(std::string_view key) noexcept { return key.empty() || key == kAuto; }

/// `auto`: bvh8, or bvh4_motion for what moves.
[[nodiscard]] std::string_view resolve_structure(std::string_view structure, bool moves) noexcept;
/// `auto`: watertight, or pluecker where the structure has no kernels of it (embree).
[[nodiscard]] std::string_view resolve_intersector(std::string_view intersector, std::string_view structure,
                                                   std::span<const KernelRow> kernels);
/// `auto`: padded for the tests that promise to lose no hit, fast for the others.
[[nodiscard]] std::string_view resolve_box(std::string_view box, std::string_view intersector) noexcept;
/// `packet` and `hybrid` stand for the width of the ISA's own registers: packet8 on avx2. Others as they are, `auto`
/// too: a way of its own.
[[nodiscard]] std::string resolve_traversal(std::string_view traversal, Isa isa);
/// Rays of a packet of the way of traversal: 8 of packet8, hybrid8, packet8_coherent; 0 where it has none.
[[nodiscard]] unsigned packet_width(std::string_view traversal) noexcept;
/// One line: why the way of traversal, a key of the kernel table, has no such threshold ("hybrid4 has packets of 4
/// rays: no threshold of 8"). Empty where it has, for kOwn, and where the way reads none.
[[nodiscard]] std::string why_no_threshold(std::string_view traversal, unsigned hybrid_threshold);

}  // namespace arboretum
