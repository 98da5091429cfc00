#include "structures/kdtree/clip.h"

#include <algorithm>
#include <limits>
#include <span>

#include "core/rounding.h"
#include "structures/clipped_triangle.h"

namespace arboretum::kdtree {
namespace {

using Point = ClippedTriangle::Point;

/// Bounds that grow by points, in double; -upper in the place of upper, so that both are minima.
struct Extent {
  Point lower{kNone, kNone, kNone}, neg_upper{kNone, kNone, kNone};

  void add(const Point& p) noexcept {
    for (std::size_t k = 0; k < 3; ++k)
      lower[k] = std::min(lower[k], p[k]), neg_upper[k] = std::min(neg_upper[k], -p[k]);
  }
  /// Rounded outward, cut to the box.
  [[nodiscard]] Bounds3f within(const Bounds3f& box) const noexcept {
    if (lower[0] == kNone) return {};
    Bounds3f bounds;
    for (std::size_t k = 0; k < 3; ++k) {
      bounds.lower[k] = std::max(box.lower[k], rounded_down(lower[k]));
      bounds.upper[k] = std::min(box.upper[k], -rounded_down(neg_upper[k]));
    }
    return bounds;
  }
  static constexpr double kNone = std::numeric_limits<double>::infinity();
};

}  // namespace

Bounds3f clipped_bounds(const std::array<Vec3f, 3>& corners, const Bounds3f& box) noexcept {
  const ClippedTriangle part(corners, box);
  Extent extent;
  for (const Point& p : part.corners()) extent.add(p);
  return extent.within(box);
}

void clipped_bounds(const std::array<Vec3f, 3>& corners, const Bounds3f& box, int axis, float plane, Bounds3f& left,
                    Bounds3f& right) noexcept {
  const ClippedTriangle part(corners, box);
  const std::span<const Point> points = part.corners();
  const auto k = std::size_t(axis);
  Extent below, above;
  const Point* a = points.empty() ? nullptr : &points.back();
  double da = a ? (*a)[k] - plane : 0.0;
  for (const Point& b : points) {
    const double db = b[k] - plane;
    if ((da < 0 && db > 0) || (da > 0 && db < 0)) {
      const double s = da / (da - db);
      Point p;
      for (std::size_t j = 0; j < 3; ++j) p[j] = (*a)[j] + s * (b[j] - (*a)[j]);
      p[k] = plane;
      below.add(p), above.add(p);
    }
    if (db <= 0) below.add(b);
    if (db >= 0) above.add(b);
    a = &b, da = db;
  }
  Bounds3f low = box, high = box;
  low.upper[k] = high.lower[k] = plane;
  left = below.within(low), right = above.within(high);
}

}  // namespace arboretum::kdtree
