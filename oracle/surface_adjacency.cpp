#include "oracle/surface_adjacency.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "core/exact/determinant.h"

namespace arboretum {
namespace {

Triple<double> from(Vec3f origin, Vec3f p) {
  return {double(p.x) - origin.x, double(p.y) - origin.y, double(p.z) - origin.z};
}

double size_of(const Triple<double>& a) {
  return std::max({std::fabs(a[0]), std::fabs(a[1]), std::fabs(a[2])});
}

/// Side of `p` of the plane through the edge along the ray; 0 where doubles cannot tell.
int side(const Ray& ray, Vec3f a, Vec3f b, Vec3f p) {
  const Triple<double> edge = from(a, b), third = from(a, p),
                       d{ray.direction.x, ray.direction.y, ray.direction.z};
  const double value = determinant(edge, third, d),
               bound = 0x1p-47 * size_of(edge) * size_of(third) * size_of(d);
  return value > bound ? 1 : value < -bound ? -1 : 0;
}

}  // namespace

SurfaceAdjacency::SurfaceAdjacency(const TriangleMesh& mesh) : mesh_(mesh) {
  const std::vector<Vec3f>& points = mesh.vertices;
  std::vector<std::uint32_t> order;
  order.reserve(points.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) {
    if (is_finite(points[i])) order.push_back(i);
  }
  const auto less = [&mesh](std::uint32_t i, std::uint32_t j) {
    for (std::size_t k = 0; k < mesh.frames(); ++k) {
      const Vec3f &p = mesh.frame(k)[i], &q = mesh.frame(k)[j];
      if (p != q) return std::tie(p.x, p.y, p.z) < std::tie(q.x, q.y, q.z);
    }
    return i < j;
  };
  const auto same = [&mesh](std::uint32_t i, std::uint32_t j) {
    for (std::size_t k = 0; k < mesh.frames(); ++k)
      if (mesh.frame(k)[i] != mesh.frame(k)[j]) return false;
    return true;
  };
  std::sort(order.begin(), order.end(), less);
  welded_.resize(points.size());
  std::iota(welded_.begin(), welded_.end(), 0u);
  for (std::size_t k = 1; k < order.size(); ++k) {
    if (same(order[k], order[k - 1])) welded_[order[k]] = welded_[order[k - 1]];
  }

  edges_.reserve(3 * mesh.size());
  spokes_.reserve(6 * mesh.size());
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    const std::uint32_t v[3] = {welded_[t.a], welded_[t.b], welded_[t.c]};
    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
    if (!is_finite(points[v[0]]) || !is_finite(points[v[1]]) || !is_finite(points[v[2]])) continue;
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t a = v[k], b = v[(k + 1) % 3];
      edges_.push_back({std::min(a, b), std::max(a, b), v[(k + 2) % 3]});
      spokes_.push_back({a, b});
      spokes_.push_back({b, a});
    }
  }
  std::sort(edges_.begin(), edges_.end());
  std::sort(spokes_.begin(), spokes_.end());
  spokes_.erase(std::unique(spokes_.begin(), spokes_.end()), spokes_.end());
}

bool SurfaceAdjacency::is_crossed(const Ray& ray, FrameTime at, std::uint32_t a, std::uint32_t b) const {
  const auto [first, last] =
      std::equal_range(edges_.begin(), edges_.end(), Edge{std::min(a, b), std::max(a, b), 0});
  if (last - first != 2) return false;
  const Vec3f p = mesh_.position(a, at), q = mesh_.position(b, at);
  return side(ray, p, q, mesh_.position(first->third, at)) * side(ray, p, q, mesh_.position((first + 1)->third, at)) < 0;
}

bool SurfaceAdjacency::passes_through(const Ray& ray, FrameTime at, std::uint32_t triangle, double u, double v) const {
  const Triangle& t = mesh_.triangles[triangle];
  const std::uint32_t corner[3] = {welded_[t.a], welded_[t.b], welded_[t.c]};
  const double weight[3] = {1.0 - u - v, u, v};
  int small = 0, last_small = 0, large = 0;
  for (int k = 0; k < 3; ++k) {
    if (weight[k] <= kNear) {
      ++small, last_small = k;
    } else {
      large = k;
    }
  }
  if (small == 0) return true;
  if (small == 1) return is_crossed(ray, at, corner[(last_small + 1) % 3], corner[(last_small + 2) % 3]);
  const std::uint32_t vertex = corner[large];
  const auto first =
      std::lower_bound(spokes_.begin(), spokes_.end(), std::array<std::uint32_t, 2>{vertex, 0});
  bool any = false;
  for (auto spoke = first; spoke != spokes_.end() && (*spoke)[0] == vertex; ++spoke) {
    if (!is_crossed(ray, at, vertex, (*spoke)[1])) return false;
    any = true;
  }
  return any;
}

}  // namespace arboretum
