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

/// Ear clipping is cubic at worst; larger polygons that are not convex are fanned.
constexpr std::size_t kMaxClipped = 1024;

}  // namespace

void triangulate(std::span<const std::uint32_t> corners, std::span<const Vec3f> vertices,
                 std::vector<Triangle>& triangles) {
  if (corners.size() == 3) {
    triangles.push_back({corners[0], corners[1], corners[2]});
    return;
  }
  const std::vector<Point2> points = project(corners, vertices);
  std::vector<std::uint32_t> left(corners.size());
  for (std::uint32_t i = 0; i < left.size(); ++i) left[i] = i;

  const auto is_ear = [&](std::size_t i) {
    const std::size_t n = left.size();
    const std::uint32_t ia = left[(i + n - 1) % n], ib = left[i], ic = left[(i + 1) % n];
    const Point2 a = points[ia], b = points[ib], c = points[ic];
    if (!(turn(a, b, c) > 0.0)) return false;
    for (const std::uint32_t k : left) {
      if (k == ia || k == ib || k == ic) continue;
      if (corners[k] == corners[ia] || corners[k] == corners[ib] || corners[k] == corners[ic]) continue;
      const Point2 p = points[k];
      if (turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0) return false;
    }
    return true;
  };
  if (corners.size() > kMaxClipped || is_strictly_convex(points)) {
    for (std::size_t i = 1; i + 1 < corners.size(); ++i) triangles.push_back({corners[0], corners[i], corners[i + 1]});
    return;
  }
  std::size_t next = 1;
  while (left.size() > 3) {
    const std::size_t n = left.size();
    std::size_t ear = next % n;
    std::size_t tried = 0;
    while (tried < n && !is_ear(ear)) ear = (ear + 1) % n, ++tried;
    if (tried == n) ear = 1;  // no ear: not a simple polygon; any corner will do
    triangles.push_back({corners[left[(ear + n - 1) % n]], corners[left[ear]], corners[left[(ear + 1) % n]]});
    left.erase(left.begin() + std::ptrdiff_t(ear));
    next = ear;
  }
  triangles.push_back({corners[left[0]], corners[left[1]], corners[left[2]]});
}

}  // namespace arboretum
