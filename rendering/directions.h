// Directions in which rays leave surfaces: cosine-distributed ones, and the least angle that is safe.
#pragma once

#include "scenes/vec3d.h"

namespace arboretum {

/// A secondary ray leaves its surface at least this steeply (sine to the surface): a direction rounded to
/// float32 must not point back into it.
inline constexpr double kLeastSine = 0x1p-20;

/// The unit direction, turned away from the surface where it is too grazing to leave it for sure. `side`: the normal on
/// the side that the ray is to be on.
[[nodiscard]] inline Vec3f leaving(Vec3d direction, Vec3d side) noexcept {
  direction = normalize(direction);
  const double sine = dot(direction, side);
  if (sine < kLeastSine) direction = normalize(direction + side * (kLeastSine - sine));
  return to_float(direction);
}

/// Cosine-distributed about +z from a number in [0, 1) and an angle; by Malley's method, from the unit disc.
[[nodiscard]] inline Vec3d cosine_direction(double u, const UnitCircle& circle) noexcept {
  const double r = std::sqrt(u);
  return {r * circle.cosine, r * circle.sine, std::sqrt(1.0 - u)};
}

}  // namespace arboretum
