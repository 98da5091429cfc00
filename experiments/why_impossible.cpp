#include "experiments/why_impossible.h"

#include <fmt/format.h>

#include <algorithm>

#include "experiments/call_axis.h"
#include "traversal/kernel_keys.h"

namespace arboretum {
namespace {

constexpr std::string_view kEmbreeMissing = "this build has no embree: install libembree-dev and build again";

std::string lacks_builder(const StructureEntry& entry, const std::string& builder) {
  const auto& builders = entry.info.builders;
  if (builders.empty() || std::ranges::find(builders, builder) != builders.end()) return {};
  return fmt::format("{} has no builder {} (it takes {})", entry.info.name, builder, fmt::join(builders, ", "));
}

/// Why the structure below cannot be, or not so; empty where it can.
std::string impossible_below(const Cell& cell, const Registry& registry) {
  const std::string& name = cell.parameters.below;
  const StructureEntry* below = registry.structure(name);
  std::string why = below ? why_not_below(below->info) : "this build has no structure of that name";
  if (why.empty()) why = lacks_builder(*below, cell.builder);
  if (why.empty()) why = below->info.why_not_built(cell.builder, cell.leaf);
  if (why.empty() && !registry.kernel(name, cell.leaf, cell.intersector, cell.box, cell.traversal, cell.isa)) {
    why = registry.why_no_kernel(name, cell.leaf, cell.intersector, cell.box, cell.traversal, cell.isa);
    if (why.empty()) why = "no such kernel in this build";
  }
  return why.empty() ? why : fmt::format("{} over {}: {}", cell.structure, name, why);
}

}  // namespace

std::string why_impossible(Cell& cell, bool moves, const Registry& registry) {
  const StructureEntry* entry = registry.structure(cell.structure);
  if (!entry) return std::string(kEmbreeMissing);
  if (moves && !entry->info.holds_motion)
    return fmt::format("{} holds one moment, and the scene moves", cell.structure);
  if (!moves && entry->info.needs_motion)
    return fmt::format("{} is for moving scenes, and nothing moves", cell.structure);
  // First what is below: builder and leaf are its own.
  if (entry->info.takes_below && !moves) {
    if (std::string why = impossible_below(cell, registry); !why.empty()) return why;
  }
  if (const std::string why = lacks_builder(*entry, cell.builder); !why.empty()) return why;
  if (std::string why = entry->info.why_not_built(cell.builder, cell.leaf); !why.empty()) return why;
  cell.kernel = registry.kernel(cell.structure, cell.leaf, cell.intersector, cell.box, cell.traversal, cell.isa);
  if (!cell.kernel) {
    const std::string why =
        registry.why_no_kernel(cell.structure, cell.leaf, cell.intersector, cell.box, cell.traversal, cell.isa);
    return why.empty() ? "no such kernel in this build" : why;
  }
  const std::string why = why_no_threshold(cell.traversal, cell.settings.hybrid_threshold);
  return why.empty() ? why_no_call(cell) : why;
}

}  // namespace arboretum
