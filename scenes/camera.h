// Camera rays, and the view of a scene that has no camera.
#pragma once

#include <array>

#include "core/bounds.h"
#include "core/ray.h"
#include "scenes/scene.h"
#include "scenes/vec3d.h"

namespace arboretum {

/// A camera that sees the whole box from a fixed three-quarter view, y up.
[[nodiscard]] Camera frame_bounds(const Bounds3f& bounds);
/// The scene's camera, or frame_bounds of its mesh.
[[nodiscard]] Camera view_of(const Scene& scene);

/// Makes rays of a camera for a picture of given size; the same bits on every machine.
class RayGenerator {
 public:
  RayGenerator(const Camera& camera, unsigned width, unsigned height);
  /// The pinhole ray through picture position (x, y) in pixels, y downwards; (0.5, 0.5) is the first pixel's
  /// centre. The direction has unit length, the interval is [0, infinity).
  [[nodiscard]] Ray ray(double x, double y) const noexcept;
  /// The ray of a thin lens through the same picture position: from the point (lens_x, lens_y) of the unit disc, scaled
  /// by the camera's aperture, towards where the pinhole ray is at the focus distance. For an aperture of 0 the pinhole
  /// ray, bit for bit.
  [[nodiscard]] Ray ray(double x, double y, double lens_x, double lens_y) const noexcept;
  [[nodiscard]] Vec3f origin() const noexcept { return origin_; }
  /// Picture position of a point; NaN where it lies beside or behind the camera.
  [[nodiscard]] std::array<float, 2> pixel(Vec3d point) const noexcept;

 private:
  Vec3f origin_;
  Vec3d forward_, corner_, step_x_, step_y_;
  Vec3d lens_x_, lens_y_;       ///< the aperture's radius along the picture's axes
  double inverse_focus_ = 0.0;  ///< 0: a pinhole
};

}  // namespace arboretum
