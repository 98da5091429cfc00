// What the intersectors with precomputed triangles read, computed in double from the corners and rounded once to float.
//
// All numbers are NaN, and the triangle is never hit, where a corner is not finite or a number is beyond float's range,
// as those of triangles without area mostly are; coordinates within 2^-40 .. 2^40 stay clear of that.
#pragma once

#include <array>
#include <cstdint>

#include "core/vec3.h"

namespace arboretum {

/// The affine map that takes corner 0 to the origin, corners 1 and 2 to the first two unit vectors, and one axis
/// vector, that along which the normal is largest, to the third: rows u, v, height, each x y z and offset (Baldwin and
/// Weber, JCGT 5(3) 2016).
[[nodiscard]] std::array<float, 12> unit_triangle_transform(const std::array<Vec3f, 3>& corner) noexcept;

/// Three planes, each normal and offset (Havel and Herout, TVCG 16(3) 2010): the triangle's, times a power of two that
/// brings its normal's largest component to 1 .. 2 (the paper's is not scaled, which costs range); those that give u
/// and v of a point in the first. A point p lies on plane 0 where n.p = offset; u and v are n.p + offset.
[[nodiscard]] std::array<float, 12> barycentric_planes(const std::array<Vec3f, 3>& corner) noexcept;

/// The triangle projected along the axis on which its normal is largest (Wald, thesis 2004, 7.1.1; Badouel, Graphics
/// Gems 1990). With a, b the next two axes in turn: the plane is p_axis + number[0] p_a + number[1] p_b = number[2]; u
/// = number[3] p_a + number[4] p_b + number[5], v likewise with the last three.
struct ProjectedTriangle {
  std::array<float, 9> number;
  std::int32_t axis;
};
[[nodiscard]] ProjectedTriangle projected_triangle(const std::array<Vec3f, 3>& corner) noexcept;

}  // namespace arboretum
