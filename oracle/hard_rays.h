// Hard rays: rays of the kinds that intersectors and box tests get wrong, aimed at a given mesh. The kinds follow the
// groups of tests/hard_cases.json: edges, vertices, grazing, axis-parallel, in box faces, far away, interval ends, no
// rays at all.
//
// One ray in eight has a direction up to 2^40 times as long or as short.
//
// Ray number i of a seed is the same whatever the batch that it is made in, and on every machine.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/mesh.h"
#include "core/ray.h"
#include "oracle/surface_adjacency.h"

namespace arboretum {

enum class HardKind : unsigned char {
  vertex,    ///< at a vertex; every fourth passes through it exactly, where the numbers allow
  edge,      ///< at a point of an edge that two triangles share
  border,    ///< at a point of an edge of one triangle, or of more than two
  interior,  ///< at a point within a triangle
  grazing,   ///< nearly in a triangle's plane
  axis,      ///< along an axis, through a vertex, an edge or a triangle; zeros of both signs
  plane,     ///< in the plane of a box face (and so in planes that trees split at), through a vertex or beside it
  surface,   ///< begins on a triangle, or off it by its rounding, in any direction
  far,       ///< from 4 to 2^27 scene radii away at a vertex, an edge or a triangle
  interval,  ///< tnear or tfar at the hit, or an ulp beside it
  invalid,   ///< no ray at all: NaN, infinity, zero direction, empty interval
  given      ///< not made here: of a cases file
};
inline constexpr std::array<std::string_view, 12> kHardKindNames{"vertex",  "edge",     "border",  "interior",
                                                                 "grazing", "axis",     "plane",   "surface",
                                                                 "far",     "interval", "invalid", "given"};

[[nodiscard]] constexpr std::string_view to_string(HardKind kind) noexcept {
  return kHardKindNames[static_cast<std::size_t>(kind)];
}
/// The kinds that rays can be made of, in their order.
inline constexpr std::size_t kMadeKinds = kHardKindNames.size() - 1;

struct HardRays {
  std::vector<Ray> rays;
  std::vector<float> times;            ///< of a mesh that moves; else empty
  std::vector<HardKind> kinds;         ///< one a ray
  std::vector<std::uint32_t> sources;  ///< the triangle that a `surface` ray starts on; else kNoPrimitive
  [[nodiscard]] RayBatch batch() const noexcept { return {rays, times}; }
};

class HardRayMaker {
 public:
  /// The mesh must outlive it and have a triangle. O(n log n).
  explicit HardRayMaker(const TriangleMesh& mesh);

  /// Whether the mesh has what rays of the kind are aimed at (a mesh without border edges has no `border` rays).
  [[nodiscard]] bool has(HardKind kind) const noexcept;
  /// Rays `first` .. `first + count` of the seed; ray i is of kinds[i % kinds.size()]. The mesh must have every kind
  /// named. Uses all TBB threads allowed to the caller.
  [[nodiscard]] HardRays make(std::uint64_t seed, std::uint64_t first, std::size_t count,
                              std::span<const HardKind> kinds) const;

 private:
  class Draw;
  struct EdgeOf {
    std::uint32_t triangle;
    std::uint32_t edge;  ///< between corners edge and (edge + 1) % 3
  };

  const TriangleMesh& mesh_;
  std::vector<EdgeOf> shared_, border_;
  Bounds3f bounds_;
  float radius_;
};

/// offset * (1, -3/4, 1/2): by what a scene is moved, along no axis and no diagonal.
[[nodiscard]] constexpr std::array<double, 3> displacement(double offset) noexcept {
  return {offset, -0.75 * offset, 0.5 * offset};
}
/// Every vertex v becomes (v + displacement(offset)) * 2^exponent, rounded after the addition. Instances are laid
/// out, but for offset 0 and exponent 0, which give a copy of the mesh.
[[nodiscard]] TriangleMesh moved_and_scaled(const TriangleMesh& mesh, double offset, int exponent);

}  // namespace arboretum
