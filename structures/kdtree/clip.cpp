#include "structures/kdtree/clip.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace arboretum::kdtree {
namespace {

using Point = std::array<double, 3>;

/// A convex polygon. Each of the six planes adds one corner; where rounding has bent it, no plane can add more than half as
/// many as there were: 3, 4, 6, 9, 13, 19, 28.
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

[[nodiscard]] float round_down(double x) noexcept {
  const float f = float(x);
  return double(f) <= x ? f : std::nextafter(f, -std::numeric_limits<float>::infinity());
}
[[nodiscard]] float round_up(double x) noexcept {
  const float f = float(x);
  return double(f) >= x ? f : std::nextafter(f, std::numeric_limits<float>::infinity());
}

}  // namespace

Bounds3f clipped_bounds(const std::array<Vec3f, 3>& corners, const Bounds3f& box) noexcept {
  Polygon polygon[2];
  int now = 0;
  polygon[0].size = 3;
  for (std::size_t i = 0; i < 3; ++i) polygon[0].point[i] = {corners[i].x, corners[i].y, corners[i].z};
  for (int axis = 0; axis < 3; ++axis) {
    const std::size_t k = std::size_t(axis);
    const float low = std::min({corners[0][k], corners[1][k], corners[2][k]}), high = std::max({corners[0][k], corners[1][k], corners[2][k]});
    if (low < box.lower[k]) clip(polygon[now], axis, box.lower[k], 1.0, polygon[1 - now]), now = 1 - now;
    if (polygon[now].size == 0) return {};
    if (high > box.upper[k]) clip(polygon[now], axis, box.upper[k], -1.0, polygon[1 - now]), now = 1 - now;
    if (polygon[now].size == 0) return {};
  }
  const Polygon& rest = polygon[now];
  Point lower = rest.point[0], upper = rest.point[0];
  for (int i = 1; i < rest.size; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      lower[k] = std::min(lower[k], rest.point[std::size_t(i)][k]), upper[k] = std::max(upper[k], rest.point[std::size_t(i)][k]);
    }
  }
  Bounds3f bounds;
  for (std::size_t k = 0; k < 3; ++k) {
    bounds.lower[k] = std::max(box.lower[k], round_down(lower[k]));
    bounds.upper[k] = std::min(box.upper[k], round_up(upper[k]));
  }
  return bounds;
}

}  // namespace arboretum::kdtree
