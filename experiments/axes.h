// The axes of a sweep: their names, the values that each can take, and one line on every value.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "experiments/registry.h"
#include "traversal/kernel_keys.h"

namespace arboretum {

enum class Axis : unsigned char { structure, builder, leaf, intersector, box, traversal, call, isa, workload, threads };
inline constexpr std::size_t kAxisCount = 10;
inline constexpr std::array<std::string_view, kAxisCount> kAxisNames{
    "structure", "builder", "leaf", "intersector", "box", "traversal", "call", "isa", "workload", "threads"};

/// One list of values an axis.
using AxisLists = std::array<std::vector<std::string>, kAxisCount>;

[[nodiscard]] constexpr std::size_t index_of(Axis axis) noexcept { return static_cast<std::size_t>(axis); }
[[nodiscard]] constexpr std::string_view to_string(Axis axis) noexcept { return kAxisNames[index_of(axis)]; }
[[nodiscard]] std::optional<Axis> parse_axis(std::string_view name) noexcept;

// kAuto (traversal/kernel_keys.h) stands for the structure's first builder, the kernel's own leaf, the box test that
// the intersector calls for: builder, leaf and box take it.
/// Of the builder axis: each builder that the structure takes.
inline constexpr std::string_view kAll = "all";
/// The value of an axis that does not apply.
inline constexpr std::string_view kNone = "-";

/// What a configuration may name on the axis, in the order of `list`: the registry's values, `auto`, `packet`
/// and `hybrid` where they exist, and what an optional library would bring (embree). Empty for `threads`.
[[nodiscard]] std::vector<std::string> known_values(Axis axis, const Registry& registry);

/// One line for `list`.
[[nodiscard]] std::string summary_of(Axis axis, std::string_view value, const Registry& registry);

}  // namespace arboretum
