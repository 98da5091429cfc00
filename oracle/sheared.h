// A ray's own coordinates, in which float intersectors round: points sheared along the ray's main axis, as in Woop,
// Benthin, Wald 2013, here in doubles; and how far the t of a float test may be off.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>

#include "core/exact/determinant.h"
#include "core/ray.h"

namespace arboretum {

/// p - origin, rounded once.
[[nodiscard]] inline Triple<double> difference_from(Vec3f origin, Vec3f p) {
  return {double(p.x) - origin.x, double(p.y) - origin.y, double(p.z) - origin.z};
}

/// A point as seen along the ray: sheared so that the ray is the origin, along its main axis.
struct Seen {
  double x, y;
  double t;     ///< depth along the main axis, in units of the direction
  double size;  ///< largest coordinate, the depth among them
};

class Sheared {
 public:
  explicit Sheared(const Ray& ray) : origin_(ray.origin) {
    const Vec3f d = ray.direction;
    z_ = std::fabs(d.x) > std::fabs(d.y) ? (std::fabs(d.x) > std::fabs(d.z) ? 0 : 2)
                                         : (std::fabs(d.y) > std::fabs(d.z) ? 1 : 2);
    x_ = (z_ + 1) % 3, y_ = (z_ + 2) % 3;
    main_ = d[z_], slope_x_ = double(d[x_]) / d[z_], slope_y_ = double(d[y_]) / d[z_];
  }
  [[nodiscard]] Seen operator()(Vec3f p) const {
    const Triple<double> v = difference_from(origin_, p);
    const double x = v[x_] - slope_x_ * v[z_], y = v[y_] - slope_y_ * v[z_];
    return {x, y, v[z_] / main_, std::max({std::fabs(x), std::fabs(y), std::fabs(v[z_])})};
  }
  /// The direction's component along the main axis.
  [[nodiscard]] double main() const noexcept { return main_; }

 private:
  Vec3f origin_;
  std::size_t x_, y_, z_;
  double slope_x_, slope_y_, main_;
};

/// Where a float test may put the hit of a triangle that the ray meets or nearly meets.
struct RoundedDistance {
  double lower, upper;
};

/// A test that rounds to float32 is off in t by less than 328 u size^3 / |area * main|, size the largest sheared
/// coordinate or depth, and not nearer or farther than the corners: edge functions are off by 14.5 u L (L + Z) < 29 u
/// size^2 (intersectors/exact_filter.h), which moves t by twice that times the corners' range of depth, 2 size; the
/// other roundings of t are 9 u size, and |area| is under 4 size^2.
[[nodiscard]] inline RoundedDistance rounded_distance(const Sheared& sheared, const Seen& a, const Seen& b,
                                                      const Seen& c) {
  const double u = b.x * c.y - b.y * c.x, v = c.x * a.y - c.y * a.x, w = a.x * b.y - a.y * b.x, area = u + v + w;
  const double size = std::max({a.size, b.size, c.size});
  const double t = (u * a.t + v * b.t + w * c.t) / area,
               error = 328 * 0x1p-24 * size * size * size / std::fabs(area * sheared.main());
  const double own = 0x1p-20 * size / std::fabs(sheared.main());  // of a corner's t
  const double nearest = std::min({a.t, b.t, c.t}) - own, farthest = std::max({a.t, b.t, c.t}) + own;
  if (!(error < farthest - nearest)) return {nearest, farthest};  // NaN where the triangle is edge on
  return {std::max(nearest, t - error), std::min(farthest, t + error)};
}

}  // namespace arboretum
