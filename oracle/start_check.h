// The check of rays that start on surfaces: whether they left theirs, and whether they left more than theirs behind.
#pragma once

#include <cstdint>
#include <span>

#include "oracle/oracle.h"

namespace arboretum {

/// What became of rays that start on surfaces, against the exact answers of the rays that start at the hit points
/// themselves and pass through the primitive that they start on (Oracle::closest_hit_from).
struct StartCheck {
  std::uint64_t rays = 0;
  /// Closest hit: the primitive that the ray starts on. Any hit: something, where nothing is.
  std::uint64_t self_hits = 0;
  /// Closest hit: another primitive, nearer by more than 2^-12 than the exact answer, at a NaN, or where nothing is:
  /// neighbours mostly.
  std::uint64_t near_hits = 0;
  /// Nothing, or another primitive farther by more than 2^-12, where something is: light leaks through it.
  std::uint64_t leaks = 0;
};

/// `sources`: the primitives that the rays start on. Throws std::invalid_argument where the sizes differ.
[[nodiscard]] StartCheck check_closest_starts(std::span<const ExactHit> truth, std::span<const Hit> answers,
                                              std::span<const std::uint32_t> sources);
[[nodiscard]] StartCheck check_any_starts(std::span<const ExactHit> truth, std::span<const std::uint8_t> answers);

}  // namespace arboretum
