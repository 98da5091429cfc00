#include "scenes/camera.h"

#include <algorithm>
#include <limits>

namespace arboretum {

Camera frame_bounds(const Bounds3f& bounds) {
  Camera camera;
  const Vec3d lower(bounds.lower), upper(bounds.upper);
  const Vec3d center = (lower + upper) * 0.5;
  const double radius = std::max(0.5 * length(upper - lower), 1e-30);
  const UnitCircle half_angle(0.5 * double(camera.vertical_fov) / 360.0);
  const Vec3d towards = normalize(Vec3d{0.8, 0.5, 1.0});
  camera.look_at = to_float(center);
  camera.position = to_float(center + towards * (radius / half_angle.sine));
  camera.focus_distance = float(radius / half_angle.sine);
  return camera;
}

Camera view_of(const Scene& scene) { return scene.camera ? *scene.camera : frame_bounds(scene.mesh.bounds()); }

RayGenerator::RayGenerator(const Camera& camera, unsigned width, unsigned height) : origin_(camera.position) {
  const Vec3d forward = forward_ = normalize(Vec3d(camera.look_at) - Vec3d(camera.position));
  const Vec3d right = normalize(cross(forward, Vec3d(camera.up))) * (camera.mirror_x ? -1.0 : 1.0);
  const Vec3d up = normalize(cross(cross(forward, Vec3d(camera.up)), forward));
  const UnitCircle half_angle(0.5 * double(camera.vertical_fov) / 360.0);
  const double half_height = half_angle.sine / half_angle.cosine;
  const double pixel = 2.0 * half_height / double(height);
  step_x_ = right * pixel;
  step_y_ = up * -pixel;
  corner_ = forward - step_x_ * (0.5 * double(width)) - step_y_ * (0.5 * double(height));
  if (camera.aperture_radius > 0.0f && camera.focus_distance > 0.0f) {
    lens_x_ = right * double(camera.aperture_radius), lens_y_ = up * double(camera.aperture_radius);
    inverse_focus_ = 1.0 / double(camera.focus_distance);
  }
}

Ray RayGenerator::ray(double x, double y) const noexcept {
  return Ray{.origin = origin_, .direction = to_float(normalize(corner_ + step_x_ * x + step_y_ * y))};
}

Ray RayGenerator::ray(double x, double y, double lens_x, double lens_y) const noexcept {
  const Vec3d lens = lens_x_ * lens_x + lens_y_ * lens_y;
  return Ray{.origin = inverse_focus_ == 0.0 ? origin_ : to_float(Vec3d(origin_) + lens),
             .direction = to_float(normalize(corner_ + step_x_ * x + step_y_ * y - lens * inverse_focus_))};
}

std::array<float, 2> RayGenerator::pixel(Vec3d point) const noexcept {
  const Vec3d d = point - Vec3d(origin_);
  const double depth = dot(d, forward_);
  if (!(depth > 0.0)) return {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::quiet_NaN()};
  // The steps are at right angles to each other and to the view, the corner is where both begin.
  const Vec3d in_plane = d * (1.0 / depth) - corner_;
  return {float(dot(in_plane, step_x_) / dot(step_x_, step_x_)), float(dot(in_plane, step_y_) / dot(step_y_, step_y_))};
}

}  // namespace arboretum
