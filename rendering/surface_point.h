// SurfacePoint: a point of a surface that a ray has hit, where other rays start from.
#pragma once

#include <array>

#include "core/mesh.h"
#include "core/ray.h"
#include "rendering/self_intersection.h"
#include "scenes/vec3d.h"

namespace arboretum {

class SurfacePoint {
 public:
  /// The hit of `ray` at `time`; the point is where its barycentric coordinates say.
  SurfacePoint(const TriangleMesh& mesh, const Ray& ray, float time, const Hit& hit);

  /// In doubles.
  [[nodiscard]] Vec3d point() const noexcept { return point_; }
  /// The same on the grid of float32 (a multiple of 2^-149 a coordinate), as exact arithmetic takes it.
  [[nodiscard]] std::array<double, 3> exact_point() const noexcept;
  /// Of unit length, on the side that the incoming ray came from.
  [[nodiscard]] Vec3d normal() const noexcept { return normal_; }
  /// Whether the incoming ray came from the side that sees the corners turn counter-clockwise.
  [[nodiscard]] bool is_front() const noexcept { return front_; }
  /// Where a ray starts that leaves on the side of `side` (the normal, or its opposite).
  [[nodiscard]] Vec3f origin(Vec3d side, SelfIntersection method) const noexcept;

 private:
  [[nodiscard]] Vec3f beyond_error_bound(Vec3d side) const noexcept;

  Vec3d a_, point_, normal_, error_;
  bool front_ = true;
};

/// A float32 point moved along a unit vector by 256 steps of its own number format, or by 2^-16 where it is within 2^-5
/// of 0.
[[nodiscard]] Vec3f integer_offset(Vec3f point, Vec3f along) noexcept;

}  // namespace arboretum
