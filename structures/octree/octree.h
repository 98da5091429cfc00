// Sparse octree over a cube: triangles stand in every leaf that they touch, children are visited in the order
// of the ray's octant (an early form: Glassner, IEEE CG&A 4(10) 1984; the numbering by octant as in Revelles,
// Urena, Lastra, WSCG 2000).
//
// A node has 8 bytes; the children that exist lie next to each other, in rising number (x is bit 0, y bit 1,
// z bit 2). Boxes are not stored: face i of level l is the float lower + float(i) * (half * 2^(1-l)), half the cube's
// side (a whole one may be wider than floats go), computed by the same two roundings in the builder and in every
// kernel, so that both mean the same box. What no ray misses then follows as for stored boxes (traversal/box_test.h).
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>

#include "core/memory_meter.h"
#include "core/type_list.h"
#include "structures/accel.h"
#include "structures/leaves/leaf_lists.h"

namespace arboretum::octree {

inline constexpr unsigned kMostLevels = 21;  ///< deepest leaf; positions have so many bits
/// References a triangle at most.
inline constexpr unsigned kMostReferences = 8;

/// mask == 0: a leaf, `first` its LeafCode. Else the children that exist, and where the first of them stands.
struct Node {
  std::uint32_t first, mask;
};

/// The cube. Face i of a level: see above.
struct Cube {
  float lower[4] = {};  ///< the fourth is 0
  float half = 0.5f;
  /// Of a child of a cell of that level.
  [[nodiscard]] float child_size(unsigned level) const noexcept { return half / float(1u << level); }
  /// The largest float where it is beyond; kernels take infinity there.
  [[nodiscard]] float face(std::size_t axis, unsigned level, std::uint32_t i) const noexcept {
    return std::min(lower[axis] + float(2 * i) * child_size(level), std::numeric_limits<float>::max());
  }
  [[nodiscard]] Bounds3f box(unsigned level, const std::array<std::uint32_t, 3>& at) const noexcept {
    return {{face(0, level, at[0]), face(1, level, at[1]), face(2, level, at[2])},
            {face(0, level, at[0] + 1), face(1, level, at[1] + 1), face(2, level, at[2] + 1)}};
  }
};

class Octree final : public Accel {
 public:
  static constexpr std::string_view kName = "octree";
  [[nodiscard]] static const StructureInfo& static_info();
  [[nodiscard]] const StructureInfo& info() const noexcept override { return static_info(); }
  /// Leaves hold at most kMostReferences references a triangle in all, whatever the scene, and lie no deeper
  /// than max_depth (0: 21) or where cells reach float resolution. Throws UserError for parameters out of
  /// range and for 2^28 leaf blocks.
  void build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) override;
  [[nodiscard]] bool visit(StructureVisitor& visitor) const override;
  void archive(Archive& archive) override;
  [[nodiscard]] std::size_t bytes() const noexcept override { return nodes_.size() * sizeof(Node) + leaves_.bytes(); }

  [[nodiscard]] const Node* nodes() const noexcept { return nodes_.data(); }  ///< the root first
  [[nodiscard]] const Cube& cube() const noexcept { return cube_; }
  [[nodiscard]] const LeafStore& leaves() const noexcept { return leaves_; }
  [[nodiscard]] float max_coordinate() const noexcept { return max_coordinate_; }

 private:
  MeteredVector<Node> nodes_;
  Cube cube_;
  LeafStore leaves_;
  float max_coordinate_ = 0.0f;
};

using Structures = TypeList<Octree>;

}  // namespace arboretum::octree
