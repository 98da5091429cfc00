// Clipping of triangles by planes across an axis: what spatial splits leave of a triangle on their two sides.
#pragma once

#include <array>

#include "core/bounds.h"

namespace arboretum {

/// Box of the part of a triangle whose coordinate on `axis` lies in [lower, upper]. Computed in double and rounded
/// outward: it holds every point of that part; where the triangle is not clipped it is the triangle's own box. Empty
/// where the triangle does not reach the slab.
[[nodiscard]] Bounds3f clip_to_slab(const std::array<Vec3f, 3>& corners, int axis, float lower, float upper) noexcept;

/// Boxes of the parts of a triangle on either side of a plane across an axis, as clip_to_slab() rounds them.
void clip_by_plane(const std::array<Vec3f, 3>& corners, int axis, float plane, Bounds3f& low, Bounds3f& high) noexcept;

}  // namespace arboretum
