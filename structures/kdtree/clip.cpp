#include "structures/kdtree/clip.h"

#include <algorithm>
#include <cstdint>
#include <limits>

#include "core/rounding.h"

namespace arboretum::kdtree {
namespace {

using Point = std::array<double, 3>;

/// A convex polygon. Each of the six planes adds one corner; where rounding has bent it, no plane can add more than
/// half as many as there were: 3, 4, 6, 9, 13, 19, 28.
struct Polygon {
  std::array<Point, 28> point;
  int size = 0;
};

/// Keeps what lies on the side of `plane` where sign * (x - plane) >= 0 (Sutherland and Hodgman 1974).
void clip(const Polygon& in, int axis, double plane, double sign, Polygon& out) noexcept {
  out.size = 0;
  const Point* a = &in.point[std::size_t(in.size - 1)];
  double da = sign * ((*a)[std::size_t(axis)] - plane);
  for (int i = 0; i < in.size; ++i) {
    const Point* b = &in.point[std::size_t(i)];
    const double db = sign * ((*b)[std::size_t(axis)] - plane);
    if ((da < 0) != (db < 0)) {
      const double s = da / (da - db);
      Point& p = out.point[std::size_t(out.size++)];
      for (std::size_t k = 0; k < 3; ++k) p[k] = (*a)[k] + s * ((*b)[k] - (*a)[k]);
      p[std::size_t(axis)] = plane;
    }
    if (!(db < 0)) out.point[std::size_t(out.size++)] = *b;
    a = b, da = db;
  }
}

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

/// The part of the triangle in the closed box; a polygon without points where there is none. Uses both polygons.
const Polygon& clip_to(const std::array<Vec3f, 3>& corners, const Bounds3f& box, Polygon (&polygon)[2]) noexcept {
  int now = 0;
  polygon[0].size = 3;
  for (std::size_t i = 0; i < 3; ++i) polygon[0].point[i] = {corners[i].x, corners[i].y, corners[i].z};
  for (int axis = 0; axis < 3; ++axis) {
    const std::size_t k = std::size_t(axis);
    const float low = std::min({corners[0][k], corners[1][k], corners[2][k]}),
                high = std::max({corners[0][k], corners[1][k], corners[2][k]});
    if (low < box.lower[k]) clip(polygon[now], axis, box.lower[k], 1.0, polygon[1 - now]), now = 1 - now;
    if (polygon[now].size == 0) break;
    if (high > box.upper[k]) clip(polygon[now], axis, box.upper[k], -1.0, polygon[1 - now]), now = 1 - now;
    if (polygon[now].size == 0) break;
  }
  return polygon[now];
}

}  // namespace

Bounds3f clipped_bounds(const std::array<Vec3f, 3>& corners, const Bounds3f& box) noexcept {
  Polygon polygon[2];
  const Polygon& part = clip_to(corners, box, polygon);
  Extent extent;
  for (int i = 0; i < part.size; ++i) extent.add(part.point[std::size_t(i)]);
  return extent.within(box);
}

void clipped_bounds(const std::array<Vec3f, 3>& corners, const Bounds3f& box, int axis, float plane, Bounds3f& left,
                    Bounds3f& right) noexcept {
  Polygon polygon[2];
  const Polygon& part = clip_to(corners, box, polygon);
  const auto k = std::size_t(axis);
  Extent below, above;
  const Point* a = part.size == 0 ? nullptr : &part.point[std::size_t(part.size - 1)];
  double da = a ? (*a)[k] - plane : 0.0;
  for (int i = 0; i < part.size; ++i) {
    const Point* b = &part.point[std::size_t(i)];
    const double db = (*b)[k] - plane;
    if ((da < 0 && db > 0) || (da > 0 && db < 0)) {
      const double s = da / (da - db);
      Point p;
      for (std::size_t j = 0; j < 3; ++j) p[j] = (*a)[j] + s * ((*b)[j] - (*a)[j]);
      p[k] = plane;
      below.add(p), above.add(p);
    }
    if (db <= 0) below.add(*b);
    if (db >= 0) above.add(*b);
    a = b, da = db;
  }
  Bounds3f low = box, high = box;
  low.upper[k] = high.lower[k] = plane;
  left = below.within(low), right = above.within(high);
}

}  // namespace arboretum::kdtree
