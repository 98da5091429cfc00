// Whether three float32 points are exactly collinear: such a triangle is never hit, whatever rounding makes of its
// normal.
#pragma once

#include <cmath>

#include "core/vec3.h"

namespace arboretum {

/// Whether three points of the plane, float32 numbers in doubles, are clearly not collinear.
[[nodiscard]] inline bool clearly_not_collinear(double ax, double ay, double bx, double by, double cx,
                                                double cy) noexcept {
  const double left = (bx - ax) * (cy - ay), right = (by - ay) * (cx - ax);
  constexpr double kErrorBound = 4.0 * 0x1p-53;  // Shewchuk's ccwerrboundA is (3 + 16 u) u
  return std::abs(left - right) > kErrorBound * (std::abs(left) + std::abs(right));
}

/// has_zero_area(), decided in all three projections.
[[nodiscard]] bool is_exactly_flat(Vec3f a, Vec3f b, Vec3f c) noexcept;

/// Whether the triangle's area is exactly zero, for any finite corners; false where one is not finite.
[[nodiscard]] inline bool has_zero_area(Vec3f a, Vec3f b, Vec3f c) noexcept {
  return !clearly_not_collinear(a.x, a.y, b.x, b.y, c.x, c.y) && is_exactly_flat(a, b, c);
}

}  // namespace arboretum
