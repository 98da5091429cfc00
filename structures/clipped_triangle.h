// ClippedTriangle: the part of a triangle that lies in a closed box, as a polygon, in double (Sutherland and Hodgman
// 1974).
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

#include "core/bounds.h"

namespace arboretum {

class ClippedTriangle {
 public:
  using Point = std::array<double, 3>;

  ClippedTriangle(const std::array<Vec3f, 3>& corners, const Bounds3f& box) noexcept {
    polygon_[0].size = 3;
    for (std::size_t i = 0; i < 3; ++i) polygon_[0].point[i] = {corners[i].x, corners[i].y, corners[i].z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float low = std::min({corners[0][axis], corners[1][axis], corners[2][axis]}),
                  high = std::max({corners[0][axis], corners[1][axis], corners[2][axis]});
      if (low < box.lower[axis]) clip(axis, box.lower[axis], 1.0);
      if (polygon_[now_].size == 0) return;
      if (high > box.upper[axis]) clip(axis, box.upper[axis], -1.0);
      if (polygon_[now_].size == 0) return;
    }
  }

  /// None where the triangle does not come nearer to the box than double rounding can tell; two may coincide.
  [[nodiscard]] std::span<const Point> corners() const noexcept {
    return {polygon_[now_].point.data(), polygon_[now_].size};
  }

 private:
  /// A plane adds one corner to a convex polygon. Where rounding has bent it, the plane is passed at most twice for
  /// each corner that is cut off, so n corners leave n + n / 2 at most, whatever they are: 3, 4, 6, 9, 13, 19, 28.
  static constexpr std::size_t kMostCorners = 28;
  struct Polygon {
    std::array<Point, kMostCorners> point;
    std::size_t size = 0;
  };

  /// Keeps what lies on the side of `plane` where sign * (x - plane) >= 0.
  void clip(std::size_t axis, double plane, double sign) noexcept {
    const Polygon& in = polygon_[now_];
    Polygon& out = polygon_[1 - now_];
    out.size = 0;
    const Point* a = &in.point[in.size - 1];
    double da = sign * ((*a)[axis] - plane);
    for (std::size_t i = 0; i < in.size; ++i) {
      const Point* b = &in.point[i];
      const double db = sign * ((*b)[axis] - plane);
      if ((da < 0) != (db < 0)) {
        const double s = da / (da - db);
        Point& p = out.point[out.size++];
        for (std::size_t k = 0; k < 3; ++k) p[k] = (*a)[k] + s * ((*b)[k] - (*a)[k]);
        p[axis] = plane;
      }
      if (!(db < 0)) out.point[out.size++] = *b;
      a = b, da = db;
    }
    now_ = 1 - now_;
  }

  Polygon polygon_[2];
  int now_ = 0;
};

}  // namespace arboretum
