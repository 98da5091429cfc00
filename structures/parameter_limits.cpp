#include "structures/parameter_limits.h"

#include <algorithm>
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

/// Limits are those of the parameter's type: 0.01 as a float is a little less.
template <class T>
void check(const char* name, T value, const ParameterLimits& limits) {
  if (value >= T(limits.low) && value <= T(limits.high)) return;
  throw UserError(std::string(name) + ": " + text_of(value) + " is not within " + text_of(limits.low) + " .. " +
                  text_of(limits.high));
}

}  // namespace

void check_parameters(const BuilderParameters& p) {
  constexpr const BuilderLimits& limits = kBuilderLimits;
  check("bins", p.bins, limits.bins);
  check("traversal_cost", p.traversal_cost, limits.traversal_cost);
  check("intersection_cost", p.intersection_cost, limits.intersection_cost);
  check("max_leaf_blocks", p.max_leaf_blocks, limits.max_leaf_blocks);
  if (std::ranges::find(kMortonBits, p.morton_bits) == kMortonBits.end())
    throw UserError("morton_bits: " + text_of(p.morton_bits) + " is neither 30 nor 63");
  check("ploc_radius", p.ploc_radius, limits.ploc_radius);
  check("duplication_budget", p.duplication_budget, limits.duplication_budget);
  check("spatial_overlap", p.spatial_overlap, limits.spatial_overlap);
  check("spatial_gain", p.spatial_gain, limits.spatial_gain);
  check("reinsertion_rounds", p.reinsertion_rounds, limits.reinsertion_rounds);
  if (p.reinsertion_top != BuilderParameters::kOwn) check("reinsertion_top", p.reinsertion_top, limits.reinsertion_top);
  check("empty_bonus", p.empty_bonus, limits.empty_bonus);
  check("max_depth", p.max_depth, limits.max_depth);
  check("grid_density", p.grid_density, limits.grid_density);
  if (std::ranges::find(kCollapses, p.collapse) == kCollapses.end())
    throw UserError("collapse: '" + p.collapse + "' is neither optimal nor greedy");
}

}  // namespace arboretum
