#include "oracle/surface_adjacency.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <set>
#include <tuple>

#include "core/random.h"
#include "oracle/sheared.h"

namespace arboretum {
namespace {

double size_of(const Triple<double>& a) { return std::max({std::fabs(a[0]), std::fabs(a[1]), std::fabs(a[2])}); }

/// Side of `p` of the plane through the edge along the ray; 0 where doubles cannot tell.
int side(const Ray& ray, Vec3f a, Vec3f b, Vec3f p) {
  const Triple<double> edge = difference_from(a, b), third = difference_from(a, p),
                       d{ray.direction.x, ray.direction.y, ray.direction.z};
  const double value = determinant(edge, third, d), bound = 0x1p-47 * size_of(edge) * size_of(third) * size_of(d);
  return value > bound ? 1 : value < -bound ? -1 : 0;
}

/// Of the segment to the ray.
double distance(const Seen& a, const Seen& b) {
  const double x = b.x - a.x, y = b.y - a.y, square = x * x + y * y;
  const double s = square > 0 ? std::clamp(-(a.x * x + a.y * y) / square, 0.0, 1.0) : 0.0;
  return std::hypot(a.x + s * x, a.y + s * y);
}

}  // namespace

std::size_t SurfaceAdjacency::HashOfCorners::operator()(const Corner3& c) const noexcept {
  return std::size_t(random_bits(c[0], c[1], c[2]));
}

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
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    const std::uint32_t v[3] = {welded_[t.a], welded_[t.b], welded_[t.c]};
    if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) continue;
    if (!is_finite(points[v[0]]) || !is_finite(points[v[1]]) || !is_finite(points[v[2]])) continue;
    for (int k = 0; k < 3; ++k) {
      const std::uint32_t a = v[k], b = v[(k + 1) % 3];
      edges_.push_back({std::min(a, b), std::max(a, b), v[(k + 2) % 3]});
    }
  }
  std::sort(edges_.begin(), edges_.end());
}

std::pair<const SurfaceAdjacency::Edge*, const SurfaceAdjacency::Edge*> SurfaceAdjacency::at_edge(
    std::uint32_t a, std::uint32_t b) const {
  const auto [first, last] = std::equal_range(edges_.begin(), edges_.end(), Edge{std::min(a, b), std::max(a, b), 0});
  return {edges_.data() + (first - edges_.begin()), edges_.data() + (last - edges_.begin())};
}

std::size_t SurfaceAdjacency::triangles_at_edge(std::uint32_t triangle, std::size_t k) const {
  const Triangle& t = mesh_.triangles[triangle];
  const Corner3 v{welded_[t.a], welded_[t.b], welded_[t.c]};
  if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) return 0;
  const auto [first, last] = at_edge(v[k], v[(k + 1) % 3]);
  return static_cast<std::size_t>(last - first);
}

std::optional<std::uint32_t> SurfaceAdjacency::across(const Ray& ray, FrameTime at, std::uint32_t a, std::uint32_t b,
                                                      std::uint32_t third) const {
  const auto [first, last] = at_edge(a, b);
  if (last - first != 2) return std::nullopt;
  const std::uint32_t other = first->third == third ? first[1].third : first->third;
  const Vec3f p = mesh_.position(a, at), q = mesh_.position(b, at);
  if (side(ray, p, q, mesh_.position(third, at)) * side(ray, p, q, mesh_.position(other, at)) >= 0) return std::nullopt;
  return other;
}

SurfaceAdjacency::Corner3 SurfaceAdjacency::corners(std::uint32_t triangle) const {
  const Triangle& t = mesh_.triangles[triangle];
  Corner3 c{welded_[t.a], welded_[t.b], welded_[t.c]};
  std::sort(c.begin(), c.end());
  return c;
}

std::optional<SurfaceAdjacency::Patch> SurfaceAdjacency::patch(const Ray& ray, FrameTime at, std::uint32_t triangle,
                                                               double edge_rounding) const {
  constexpr std::size_t kMostTriangles = 1u << 18;
  Patch patch{{corners(triangle)}};
  std::vector<Corner3> waiting(patch.triangles.begin(), patch.triangles.end());
  std::set<std::pair<std::uint32_t, std::uint32_t>> crossed;  // edges, either way
  const Sheared sheared(ray);
  // In the order found: on all sides at once, so that the nearest border ends it
  for (std::size_t turn = 0; turn < waiting.size(); ++turn) {
    const Corner3 c = waiting[turn];
    if (c[0] == c[1] || c[1] == c[2]) return std::nullopt;
    const Seen p[3] = {sheared(mesh_.position(c[0], at)), sheared(mesh_.position(c[1], at)),
                       sheared(mesh_.position(c[2], at))};
    const RoundedDistance t = rounded_distance(sheared, p[0], p[1], p[2]);
    if (t.lower < ray.tnear || t.upper > ray.tfar) return std::nullopt;
    patch.farthest = std::max(patch.farthest, t.upper);
    const double area = std::fabs((p[1].x - p[0].x) * (p[2].y - p[0].y) - (p[1].y - p[0].y) * (p[2].x - p[0].x));
    for (std::size_t k = 0; k < 3; ++k) {
      const Seen &a = p[k], &b = p[(k + 1) % 3];
      const double width = std::hypot(b.x - a.x, b.y - a.y), size = std::max(a.size, b.size);
      const double of_function =
          edge_rounding > 0 ? edge_rounding * size * std::hypot(width, (b.t - a.t) * sheared.main()) / width : 0.0;
      const double near = std::max({kRounding * size, width > 0 ? kNear * area / width : 0.0, of_function});
      if (distance(a, b) > near) {
        if (std::fabs(a.x * b.y - a.y * b.x) <= of_function * width) return std::nullopt;
        continue;
      }
      const auto other = across(ray, at, c[k], c[(k + 1) % 3], c[(k + 2) % 3]);
      if (!other) return std::nullopt;
      Corner3 next{c[k], c[(k + 1) % 3], *other};
      crossed.insert(std::minmax(c[k], c[(k + 1) % 3]));
      std::sort(next.begin(), next.end());
      if (patch.triangles.insert(next).second) waiting.push_back(next);
      if (patch.triangles.size() > kMostTriangles) return patch;
    }
  }
  patch.ring = crossed.size() >= patch.triangles.size();
  patch.whole = true;
  return patch;
}

bool SurfaceAdjacency::passes_through(const Ray& ray, FrameTime at, std::uint32_t triangle,
                                      std::uint32_t answer) const {
  const std::optional<Patch> about = patch(ray, at, triangle, 0.0);
  if (!about) return false;
  if (!about->whole || answer >= mesh_.size()) return true;
  if (about->triangles.contains(corners(answer))) return false;
  const Sheared sheared(ray);
  const auto c = mesh_.corners(answer, at);
  return about->farthest < rounded_distance(sheared, sheared(c[0]), sheared(c[1]), sheared(c[2])).lower;
}

bool SurfaceAdjacency::passes_vertex(const Ray& ray, FrameTime at, std::uint32_t triangle) const {
  const std::optional<Patch> about = patch(ray, at, triangle, kEdgeRounding);
  return !about || !about->whole || about->ring;
}

}  // namespace arboretum
