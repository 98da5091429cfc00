#include "rendering/surface_point.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

#include "core/bounds.h"
#include "core/rounding.h"

namespace arboretum {
namespace {

/// A double rounded to a multiple of 2^-149; all beyond 2^-96 are one.
double on_grid(double x) { return std::fabs(x) < 0x1p-96 ? std::ldexp(std::nearbyint(std::ldexp(x, 149)), -149) : x; }

}  // namespace

SurfacePoint::SurfacePoint(const TriangleMesh& mesh, const Ray& ray, float time, const Hit& hit) {
  const auto corners = mesh.corners(hit.primitive, frame_at(time, mesh.frames()));
  const Vec3d a(corners[0]), ab = Vec3d(corners[1]) - a, ac = Vec3d(corners[2]) - a;
  const double u = hit.u, v = hit.v;
  a_ = a;
  point_ = a + ab * u + ac * v;
  normal_ = normalize(cross(ab, ac));
  front_ = !(dot(normal_, Vec3d(ray.direction)) > 0.0);
  if (!front_) normal_ = normal_ * -1.0;
  // Bound of the rounding error of a point computed from barycentrics in float32: gamma_7 times the sum of
  // the terms' magnitudes.
  constexpr double kUnit = 0x1p-24, kGamma7 = 7.0 * kUnit / (1.0 - 7.0 * kUnit);
  double weights[3] = {std::abs(1.0 - u - v), std::abs(u), std::abs(v)};
  for (std::size_t k = 0; k < 3; ++k) {
    error_.x += kGamma7 * weights[k] * std::abs(double(corners[k].x));
    error_.y += kGamma7 * weights[k] * std::abs(double(corners[k].y));
    error_.z += kGamma7 * weights[k] * std::abs(double(corners[k].z));
  }
}

std::array<double, 3> SurfacePoint::exact_point() const noexcept {
  return {on_grid(point_.x), on_grid(point_.y), on_grid(point_.z)};
}

Vec3f SurfacePoint::origin(Vec3d side, SelfIntersection method) const noexcept {
  switch (method) {
    case SelfIntersection::error_bound: return beyond_error_bound(side);
    case SelfIntersection::integer_offset: return integer_offset(to_float(point_), to_float(side));
    case SelfIntersection::none:
    case SelfIntersection::epsilon:
    case SelfIntersection::exclusion: break;
  }
  return to_float(point_);
}

/// Off the surface along the normal by the error bound, rounded away from it, further until the float32 point is on
/// that side of the triangle's plane.
Vec3f SurfacePoint::beyond_error_bound(Vec3d side) const noexcept {
  double distance = std::abs(side.x) * error_.x + std::abs(side.y) * error_.y + std::abs(side.z) * error_.z;
  distance = std::max(distance, 0x1p-126);
  for (int attempt = 0; attempt < 200; ++attempt, distance *= 2.0) {
    const Vec3d wanted = point_ + side * distance;
    Vec3f p = to_float(wanted);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double s = axis == 0 ? side.x : axis == 1 ? side.y : side.z;
      const double w = axis == 0 ? wanted.x : axis == 1 ? wanted.y : wanted.z;
      if (s > 0.0) p[axis] = rounded_up(w);
      if (s < 0.0) p[axis] = rounded_down(w);
    }
    if (dot(Vec3d(p) - a_, side) > 0.5 * distance) return p;
  }
  return to_float(point_);
}

Vec3f integer_offset(Vec3f point, Vec3f along) noexcept {
  constexpr float kNearZero = 1.0f / 32.0f, kStep = 1.0f / 65536.0f, kSteps = 256.0f;
  Vec3f moved;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float p = point[axis], n = along[axis];
    if (std::fabs(p) < kNearZero) {
      moved[axis] = p + kStep * n;
      continue;
    }
    const auto steps = static_cast<std::int32_t>(kSteps * n);
    moved[axis] = std::bit_cast<float>(std::bit_cast<std::int32_t>(p) + (p < 0 ? -steps : steps));
  }
  return moved;
}

}  // namespace arboretum
