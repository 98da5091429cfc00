// What the intersector `exact` asks of exact arithmetic: the few triangles that its float filter cannot decide, the
// order of hits whose distances it cannot tell apart, and the rounding of the hit that wins. Compiled once, for the
// machine's baseline; the decisions are ExactPredicate's, behind a level in doubles that settles nearly all of them.
#pragma once

#include <array>
#include <cstdint>

#include "core/ray.h"

namespace arboretum {

/// low <= exact t <= high.
struct DistanceInterval {
  float low, high;
};

/// Whether the ray meets the closed triangle at a t within the closed [tnear, tfar]; then `t` holds it. Decided exactly
/// for all finite float32 numbers; a triangle without area, or in whose plane the ray lies, is missed. The ray must be
/// valid.
[[nodiscard]] bool meets_exactly(const Ray& ray, const std::array<Vec3f, 3>& corners, DistanceInterval& t) noexcept;

/// Sign of t(first) - t(second), exactly. The ray's line must meet both.
[[nodiscard]] int compare_distances_exactly(const Ray& ray, const std::array<Vec3f, 3>& first,
                                            const std::array<Vec3f, 3>& second) noexcept;

/// A hit's t, rounded correctly from the exact value (nearest, ties to even; infinity beyond the float32 range), and
/// the weights of the second and third corner, within [0, 1], each off by no more than an ulp of itself or 2^-30.
struct RoundedHit {
  float t, u, v;
};
/// For a triangle that the ray's line meets.
[[nodiscard]] RoundedHit round_exactly(const Ray& ray, const std::array<Vec3f, 3>& corners) noexcept;

}  // namespace arboretum
