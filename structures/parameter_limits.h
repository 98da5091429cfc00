// The limits of BuilderParameters and TraversalSettings, for the command line and for programs alike, and of meshes;
// their checks.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "core/ray.h"
#include "structures/accel.h"

namespace arboretum {

/// Both ends inclusive.
struct ParameterLimits {
  double low, high;

  /// Limits are those of the value's type: 0.01 as a float is a little less. NaN is not within.
  template <class T>
  [[nodiscard]] constexpr bool hold(T value) const noexcept {
    return value >= T(low) && value <= T(high);
  }
};

struct BuilderLimits {
  ParameterLimits bins{4, 64};
  ParameterLimits traversal_cost{1e-3, 1e3}, intersection_cost{1e-3, 1e3};
  ParameterLimits max_leaf_blocks{1, 8};
  ParameterLimits morton_bits{30, 63};  ///< of these the ends alone: kMortonBits
  ParameterLimits ploc_radius{1, 128};
  ParameterLimits duplication_budget{0, 4}, spatial_overlap{0, 1}, spatial_gain{0.01, 1};
  ParameterLimits reinsertion_rounds{1, 64}, reinsertion_top{0, 65536};  ///< the second one: or kOwn
  ParameterLimits empty_bonus{0, 0.95};
  ParameterLimits max_depth{0, 63};  ///< an octree's end at 21
  ParameterLimits grid_density{0.01, 64};
};
inline constexpr BuilderLimits kBuilderLimits;
inline constexpr std::array<unsigned, 2> kMortonBits{30, 63};
inline constexpr std::array<std::string_view, 2> kCollapses{"optimal", "greedy"};

struct TraversalLimits {
  ParameterLimits hybrid_threshold{0, TraversalSettings::kWidestHybrid};
  ParameterLimits rays_in_flight{1, TraversalSettings::kMostInFlight};
};
inline constexpr TraversalLimits kTraversalLimits;

/// References that a tree of two nodes each can have, numbered in 31 bits.
inline constexpr std::size_t kMaxReferences = (std::size_t{1} << 30) - 1;

/// Throw UserError unless the limits hold `value`.
void require_within(std::string_view parameter, unsigned value, const ParameterLimits& limits);
void require_within(std::string_view parameter, float value, const ParameterLimits& limits);
/// Throws UserError for more than `most` triangles, which is a power of two less one.
void require_triangles(std::string_view structure, std::size_t triangles, std::size_t most = kMaxReferences);

/// Throws UserError, which names the first parameter that is out of its limits, whether or not a builder reads it. NaN
/// is out of any. `below` is two_level's to look at.
void check_parameters(const BuilderParameters& parameters);
/// As above of a way of traversal, whether or not it reads the setting; kOwn is within.
void check_settings(const TraversalSettings& settings);

}  // namespace arboretum
