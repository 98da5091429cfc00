#include "traversal/kernel_keys.h"

#include <algorithm>
#include <charconv>

#include "intersectors/promises.h"

namespace arboretum {

std::string_view resolve_structure(std::string_view structure, bool moves) noexcept {
  if (!is_auto(structure)) return structure;
  return moves ? "bvh4_motion" : "bvh8";
}

std::string_view resolve_intersector(std::string_view intersector, std::string_view structure,
                                     std::span<const KernelRow> kernels) {
  if (!is_auto(intersector)) return intersector;
  const bool has_watertight = std::ranges::any_of(
      kernels, [&](const KernelRow& row) { return row.structure == structure && row.intersector == "watertight"; });
  return has_watertight ? "watertight" : "pluecker";
}

std::string_view resolve_box(std::string_view box, std::string_view intersector) noexcept {
  return is_auto(box) ? box_called_for(intersector) : box;
}

std::string resolve_traversal(std::string_view traversal, Isa isa) {
  if (traversal != "packet" && traversal != "hybrid") return std::string(traversal);
  return std::string(traversal) + std::to_string(native_width(isa));
}

unsigned packet_width(std::string_view traversal) noexcept {
  unsigned rays = 0;
  for (std::string_view family : {"packet", "hybrid"}) {
    if (!traversal.starts_with(family)) continue;
    traversal.remove_prefix(family.size());
    std::from_chars(traversal.data(), traversal.data() + traversal.size(), rays);
    break;
  }
  return rays;
}

std::string why_no_threshold(std::string_view traversal, unsigned hybrid_threshold) {
  if (hybrid_threshold == TraversalSettings::kOwn || !traversal.starts_with("hybrid")) return {};
  const unsigned rays = packet_width(traversal);
  if (hybrid_threshold <= rays) return {};
  return std::string(traversal) + " has packets of " + std::to_string(rays) + " rays: no threshold of " +
         std::to_string(hybrid_threshold);
}

}  // namespace arboretum
