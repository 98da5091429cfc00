// SurfaceAdjacency: which triangles share an edge or a vertex by position (in every key frame), to tell a crack in a
// closed surface from a miss at its silhouette or border. Any mesh will do: holes, fins and degenerate triangles only
// make it say "no crack".
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <unordered_set>
#include <utility>
#include <vector>

#include "core/mesh.h"
#include "core/ray.h"

namespace arboretum {

class SurfaceAdjacency {
 public:
  /// O(n log n). The mesh must outlive it. Triangles with two corners at one position or one not finite take
  /// no part.
  explicit SurfaceAdjacency(const TriangleMesh& mesh);

  /// Whether the ray of that time, which meets `triangle`, passes through the surface there, however the vertices are
  /// rounded: the triangles about the ray, connected by edges that come near it, form a patch of one facing whose
  /// border is not near. An edge is near within kNear of a triangle's height over it, and within kRounding of its
  /// vertices' distance; a near edge that not exactly two triangles share, one on either side as seen along the ray, is
  /// a border or a silhouette. (Moving the patch's vertices by less than that moves its border not across the ray, so
  /// the patch, covering the ray once, goes on covering it.) A patch that rounding may put outside the ray's interval,
  /// in part, is none either; one of more than 2^18 triangles is taken for one. False where `answer`, a triangle or
  /// kNoPrimitive, is one of the patch: the surface was met, if at another depth; and where it is not beyond all depths
  /// at which rounding may put the patch.
  [[nodiscard]] bool passes_through(const Ray& ray, FrameTime at, std::uint32_t triangle,
                                    std::uint32_t answer = kNoPrimitive) const;

  /// Whether a test that decides each edge once, in whatever direction, may find none of the triangles about a ray that
  /// passes through the surface at `triangle`: the edges that come near it close a ring about a vertex, so that each
  /// may point to the next triangle. (Along edges that close no ring the triangles form a tree, where to go as the
  /// edges point ends: at a triangle all of whose edges point inwards.) Here an edge is near within the rounding of its
  /// function too, which grows as the edge is seen end on. Also where a border or a silhouette is as near, and where a
  /// triangle looks so flat that the ray comes as near an edge's line beyond its ends: there an edge may point to a
  /// triangle that is nowhere near.
  [[nodiscard]] bool passes_vertex(const Ray& ray, FrameTime at, std::uint32_t triangle) const;

  /// How many triangles share the edge between corners k and (k + 1) % 3; 0 where the triangle takes no part.
  [[nodiscard]] std::size_t triangles_at_edge(std::uint32_t triangle, std::size_t k) const;

  /// The watertight test displaces a sheared coordinate by at most 6 * 2^-24 of the vertex's largest.
  static constexpr double kRounding = 0x1p-20;
  static constexpr double kNear = 1e-3;
  /// The Pluecker test's edge functions, of length |edge| |sum of vertices| |direction| at most, are off by less than
  /// 10 * 2^-24 of that: seen along the ray, in largest coordinates for lengths, 10 * 3 sqrt(3) * 2^-24.
  static constexpr double kEdgeRounding = 0x1p-18;

 private:
  struct Edge {
    std::uint32_t a, b;   // welded vertices, a < b
    std::uint32_t third;  // the welded vertex across
    friend bool operator<(const Edge& p, const Edge& q) { return p.a != q.a ? p.a < q.a : p.b < q.b; }
  };
  using Corner3 = std::array<std::uint32_t, 3>;  // welded vertices, ascending
  struct HashOfCorners {
    std::size_t operator()(const Corner3& c) const noexcept;
  };
  /// Triangles about a ray, connected by edges that come near it.
  struct Patch {
    std::unordered_set<Corner3, HashOfCorners> triangles;
    double farthest = 0;  ///< t at which rounding may put a hit of one of them
    bool ring = false;    ///< more edges connect them than a tree has
    bool whole = false;   ///< false: the search was given up, since the patch is large
  };
  [[nodiscard]] Corner3 corners(std::uint32_t triangle) const;
  /// Nothing where its border, a silhouette or an end of the ray's interval is near. `edge_rounding`: kEdgeRounding,
  /// and then nothing where the line of an edge is near beyond its ends either; or 0 where edge functions are no
  /// concern.
  [[nodiscard]] std::optional<Patch> patch(const Ray& ray, FrameTime at, std::uint32_t triangle,
                                           double edge_rounding) const;
  /// The range of edges_ between two vertices.
  [[nodiscard]] std::pair<const Edge*, const Edge*> at_edge(std::uint32_t a, std::uint32_t b) const;
  /// The third vertex of the triangle across the edge a-b from `third`; nothing where the edge is no crossing.
  [[nodiscard]] std::optional<std::uint32_t> across(const Ray& ray, FrameTime at, std::uint32_t a, std::uint32_t b,
                                                    std::uint32_t third) const;

  const TriangleMesh& mesh_;
  std::vector<std::uint32_t> welded_;  // of each vertex: the lowest vertex at its position in all frames
  std::vector<Edge> edges_;            // sorted, one a triangle and edge
};

}  // namespace arboretum
