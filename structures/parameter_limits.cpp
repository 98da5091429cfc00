#include "structures/parameter_limits.h"

#include <algorithm>
#include <bit>
#include <charconv>
#include <string>

#include "core/error.h"
#include "structures/bvh/bvh.h"

namespace arboretum {
namespace {

static_assert(kBuilderLimits.max_leaf_blocks.high == bvh::kMaxLeafBlocks);

template <class T>
std::string text_of(T value) {
  char digits[32];
  return {digits, std::to_chars(digits, digits + sizeof digits, value).ptr};
}

template <class T>
void require(std::string_view parameter, T value, const ParameterLimits& limits) {
  if (limits.hold(value)) return;
  throw UserError(std::string(parameter) + ": " + text_of(value) + " is not within " + text_of(limits.low) + " .. " +
                  text_of(limits.high));
}

}  // namespace

void require_within(std::string_view parameter, unsigned value, const ParameterLimits& limits) {
  require(parameter, value, limits);
}

void require_within(std::string_view parameter, float value, const ParameterLimits& limits) {
  require(parameter, value, limits);
}

void require_triangles(std::string_view structure, std::size_t triangles, std::size_t most) {
  if (triangles <= most) return;
  throw UserError(std::string(structure) + " takes at most 2^" + std::to_string(std::bit_width(most)) +
                  " - 1 triangles");
}

void check_parameters(const BuilderParameters& p) {
  constexpr const BuilderLimits& limits = kBuilderLimits;
  require_within("bins", p.bins, limits.bins);
  require_within("traversal_cost", p.traversal_cost, limits.traversal_cost);
  require_within("intersection_cost", p.intersection_cost, limits.intersection_cost);
  require_within("max_leaf_blocks", p.max_leaf_blocks, limits.max_leaf_blocks);
  if (std::ranges::find(kMortonBits, p.morton_bits) == kMortonBits.end())
    throw UserError("morton_bits: " + text_of(p.morton_bits) + " is neither 30 nor 63");
  require_within("ploc_radius", p.ploc_radius, limits.ploc_radius);
  require_within("duplication_budget", p.duplication_budget, limits.duplication_budget);
  require_within("spatial_overlap", p.spatial_overlap, limits.spatial_overlap);
  require_within("spatial_gain", p.spatial_gain, limits.spatial_gain);
  require_within("reinsertion_rounds", p.reinsertion_rounds, limits.reinsertion_rounds);
  if (p.reinsertion_top != BuilderParameters::kOwn)
    require_within("reinsertion_top", p.reinsertion_top, limits.reinsertion_top);
  require_within("empty_bonus", p.empty_bonus, limits.empty_bonus);
  require_within("max_depth", p.max_depth, limits.max_depth);
  require_within("grid_density", p.grid_density, limits.grid_density);
  if (std::ranges::find(kCollapses, p.collapse) == kCollapses.end())
    throw UserError("collapse: '" + p.collapse + "' is neither optimal nor greedy");
}

void check_settings(const TraversalSettings& s) {
  const auto check = [](std::string_view name, unsigned value, const ParameterLimits& limits) {
    if (value != TraversalSettings::kOwn) require_within(name, value, limits);
  };
  check("hybrid_threshold", s.hybrid_threshold, kTraversalLimits.hybrid_threshold);
  check("rays_in_flight", s.rays_in_flight, kTraversalLimits.rays_in_flight);
}

}  // namespace arboretum
