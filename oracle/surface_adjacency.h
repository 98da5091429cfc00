// SurfaceAdjacency: which triangles share an edge or a vertex by position (in every key frame), to tell a crack in a closed
// surface from a miss at its silhouette or border. Any mesh will do: holes, fins and degenerate triangles
// only make it say "no crack".
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/mesh.h"
#include "core/ray.h"

namespace arboretum {

class SurfaceAdjacency {
 public:
  /// O(n log n). The mesh must outlive it. Triangles with two corners at one position or one not finite take
  /// no part.
  explicit SurfaceAdjacency(const TriangleMesh& mesh);

  /// Whether the ray of that time, which meets `triangle` at the weights u (second corner) and v (third), passes through
  /// the surface there: inside the triangle; or within kNear of an edge that exactly two triangles share, one
  /// on either side as seen along the ray; or within kNear of two edges, at a vertex all of whose edges are
  /// such.
  [[nodiscard]] bool passes_through(const Ray& ray, FrameTime at, std::uint32_t triangle, double u, double v) const;

  static constexpr double kNear = 1e-3;

 private:
  struct Edge {
    std::uint32_t a, b;   // welded vertices, a < b
    std::uint32_t third;  // the welded vertex across
    friend bool operator<(const Edge& p, const Edge& q) { return p.a != q.a ? p.a < q.a : p.b < q.b; }
  };
  [[nodiscard]] bool is_crossed(const Ray& ray, FrameTime at, std::uint32_t a, std::uint32_t b) const;

  const TriangleMesh& mesh_;
  std::vector<std::uint32_t> welded_;                 // of each vertex: the lowest vertex at its position in all frames
  std::vector<Edge> edges_;                           // sorted, one a triangle and edge
  std::vector<std::array<std::uint32_t, 2>> spokes_;  // sorted: vertex, the other end of an edge at it
};

}  // namespace arboretum
