#include "scenes/polygon.h"

#include <array>
#include <cmath>

#include "scenes/vec3d.h"

namespace arboretum {
namespace {

struct Point2 {
  double x, y;
};

double turn(Point2 a, Point2 b, Point2 c) noexcept { return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x); }

/// Projects along the largest component of Newell's normal, mirrored where needed so that the polygon turns
/// left.
std::vector<Point2> project(std::span<const std::uint32_t> corners, std::span<const Vec3f> vertices) {
  Vec3d normal;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const Vec3d a(vertices[corners[i]]), b(vertices[corners[(i + 1) % corners.size()]]);
    normal = normal + Vec3d{(a.y - b.y) * (a.z + b.z), (a.z - b.z) * (a.x + b.x), (a.x - b.x) * (a.y + b.y)};
  }
  const double nx = std::abs(normal.x), ny = std::abs(normal.y), nz = std::abs(normal.z);
  const std::size_t axis = nx > ny ? (nx > nz ? 0 : 2) : (ny > nz ? 1 : 2);
  const double sign = (axis == 0 ? normal.x : axis == 1 ? normal.y : normal.z) < 0.0 ? -1.0 : 1.0;
  std::vector<Point2> points;
  points.reserve(corners.size());
  for (const std::uint32_t corner : corners) {
    const Vec3f p = vertices[corner];
    points.push_back({sign * double(p[(axis + 1) % 3]), double(p[(axis + 2) % 3])});
  }
  return points;
}

/// Turns left at every corner, and once around in all (a star turns left too, but goes round twice).
bool is_strictly_convex(std::span<const Point2> points) {
  const std::size_t n = points.size();
  int turns_in_x = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const Point2 a = points[i], b = points[(i + 1) % n], c = points[(i + 2) % n];
    if (!(turn(a, b, c) > 0.0)) return false;
    turns_in_x += (b.x >= a.x) != (c.x >= b.x);
  }
  return turns_in_x <= 2;
}

/// Larger polygons that are not convex are fanned: the work on one is quadratic.
constexpr std::size_t kMaxClipped = 1024;

/// Ear clipping, corner by corner around. What was found outside of a corner's triangle stays there until a neighbour
/// of the corner goes: each corner asks on from where it last stopped.
class EarClipper {
 public:
  EarClipper(std::span<const std::uint32_t> corners, std::span<const Point2> points)
      : corners_(corners), points_(points), left_(corners.size()), has_gone_(corners.size()), outside_(corners.size()) {
    for (std::uint32_t i = 0; i < left_.size(); ++i) left_[i] = i;
  }

  void clip(std::vector<Triangle>& triangles) {
    std::size_t next = 1;
    while (left_.size() > 3) {
      const std::size_t n = left_.size();
      std::size_t ear = next % n;
      std::size_t tried = 0;
      while (tried < n && !is_ear(ear)) ear = after(ear), ++tried;
      if (tried == n) ear = 1;  // no ear: not a simple polygon; any corner will do
      const std::uint32_t a = left_[before(ear)], b = left_[ear], c = left_[after(ear)];
      triangles.push_back({corners_[a], corners_[b], corners_[c]});
      left_.erase(left_.begin() + std::ptrdiff_t(ear));
      has_gone_[b] = true, outside_[a] = outside_[c] = 0;
      next = ear;
    }
    triangles.push_back({corners_[left_[0]], corners_[left_[1]], corners_[left_[2]]});
  }

  [[nodiscard]] std::size_t tests() const noexcept { return tests_; }

 private:
  std::size_t before(std::size_t i) const { return i == 0 ? left_.size() - 1 : i - 1; }
  std::size_t after(std::size_t i) const { return i + 1 == left_.size() ? 0 : i + 1; }

  bool is_ear(std::size_t i) {
    const std::uint32_t ia = left_[before(i)], ib = left_[i], ic = left_[after(i)];
    const Point2 a = points_[ia], b = points_[ib], c = points_[ic];
    if (!(turn(a, b, c) > 0.0)) return false;
    for (std::uint32_t& k = outside_[ib]; k < points_.size(); ++k) {
      if (has_gone_[k] || k == ia || k == ib || k == ic) continue;
      if (corners_[k] == corners_[ia] || corners_[k] == corners_[ib] || corners_[k] == corners_[ic]) continue;
      ++tests_;
      const Point2 p = points_[k];
      if (turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0) return false;
    }
    return true;
  }

  std::span<const std::uint32_t> corners_;
  std::span<const Point2> points_;
  std::vector<std::uint32_t> left_;     ///< places of the corners that have not gone, in their order
  std::vector<std::uint8_t> has_gone_;  ///< by place
  std::vector<std::uint32_t> outside_;  ///< by place: all corners before this one are outside of its triangle
  std::size_t tests_ = 0;
};

}  // namespace

std::size_t triangulate(std::span<const std::uint32_t> corners, std::span<const Vec3f> vertices,
                        std::vector<Triangle>& triangles) {
  const std::vector<Point2> points = corners.size() > 3 ? project(corners, vertices) : std::vector<Point2>();
  if (corners.size() == 3 || corners.size() > kMaxClipped || is_strictly_convex(points)) {
    for (std::size_t i = 1; i + 1 < corners.size(); ++i) triangles.push_back({corners[0], corners[i], corners[i + 1]});
    return 0;
  }
  EarClipper clipper(corners, points);
  clipper.clip(triangles);
  return clipper.tests();
}

}  // namespace arboretum
