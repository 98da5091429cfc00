// Wide bounding volume hierarchies: bvh2, bvh4, bvh8, bvh16 as one template over the branching factor N.
//
// Nodes and leaf blocks lie in one arena and are named by 32-bit references: a byte offset (a multiple of 32), in whose
// low five bits stand 8 for a leaf and its number of blocks less one (0 .. 7).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/arena.h"
#include "core/type_list.h"
#include "structures/accel.h"

namespace arboretum::bvh {

using NodeReference = std::uint32_t;
inline constexpr NodeReference kLeafBit = 8, kBlockMask = 7, kOffsetMask = ~31u;
inline constexpr unsigned kMaxLeafBlocks = 8;

[[nodiscard]] constexpr bool is_leaf(NodeReference r) noexcept { return (r & kLeafBit) != 0; }
[[nodiscard]] constexpr unsigned block_count(NodeReference r) noexcept { return (r & kBlockMask) + 1; }
[[nodiscard]] constexpr std::size_t offset_of(NodeReference r) noexcept { return r & kOffsetMask; }

/// What all branching factors share: the arena, its root, what it was built with.
class BvhBase : public Accel {
 public:
  [[nodiscard]] std::size_t bytes() const noexcept override { return arena_.bytes(); }
  [[nodiscard]] const std::byte* base() const noexcept { return arena_.data(); }
  [[nodiscard]] NodeReference root() const noexcept { return root_; }
  /// Entries that a traversal stack can need, the root's included.
  [[nodiscard]] std::size_t stack_entries() const noexcept { return stack_entries_; }
  /// What padded box tests scale their pad with: the largest |coordinate| of the scene, or where that is not a common
  /// one, less (structures/box_pads.h).
  [[nodiscard]] float max_coordinate() const noexcept { return max_coordinate_; }
  [[nodiscard]] const std::string& leaf() const noexcept { return leaf_; }
  /// The mesh's vertices, which leaf blocks of indices name.
  [[nodiscard]] const Vec3f* vertices() const noexcept { return vertices_; }

 protected:
  /// Takes note of the mesh that rays will meet, of the root's box, and of what boxes are padded for.
  void set_scene(const TriangleMesh& mesh, const Bounds3f& bounds, float max_coordinate) noexcept;

  Arena arena_;
  NodeReference root_ = 0;
  std::size_t stack_entries_ = 1;
  float max_coordinate_ = 0.0f;
  Bounds3f bounds_;
  const Vec3f* vertices_ = nullptr;
  std::size_t triangles_ = 0;
  std::string leaf_;
};

/// A wide BVH whose nodes are written in `Format`, which has
///   kName, kSummary; kBranching, the most children; Node, a trivially copyable type; kGranule, a multiple of 32: nodes
///   and leaves lie on addresses that are multiples of it; write(Node&, boxes, references, count): the node of these
///   children, 0 of them for an empty scene; read(const Node&, boxes, references): the count, and the children as a
///   ray's box test sees them.
/// Its members are defined in wide_bvh.h and wide_refit.h, which a structure's .cpp file includes to instantiate them.
template <class Format>
class WideBvh final : public BvhBase {
 public:
  static constexpr int kBranching = Format::kBranching;
  static constexpr std::string_view kName = Format::kName;
  [[nodiscard]] static const StructureInfo& static_info();
  [[nodiscard]] const StructureInfo& info() const noexcept override { return static_info(); }
  void build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) override;
  [[nodiscard]] bool visit(StructureVisitor& visitor) const override;
  void archive(Archive& archive) override;
  void refit(const TriangleMesh& mesh) override;
};

/// planes[2 * axis + side][child], side 0 lower, 1 upper. 64, 112, 224, 448 bytes of planes and references for N = 2,
/// 4, 8, 16. A slot without a child has lower = +inf, upper = -inf, so that no ray enters it; children come first. With
/// a stride of 224 bytes on 32-byte addresses a node of N = 8 always lies on four cache lines.
template <int N>
struct alignas(32) Node {
  float planes[6][N];
  NodeReference child[N];
};
static_assert(sizeof(Node<2>) == 64 && sizeof(Node<4>) == 128 && sizeof(Node<8>) == 256 - 32 &&
              sizeof(Node<16>) == 448);

/// Child boxes as structure of arrays.
template <int N>
struct SoaNodes {
  static constexpr int kBranching = N;
  static constexpr std::string_view kName = N == 2 ? "bvh2" : N == 4 ? "bvh4" : N == 8 ? "bvh8" : "bvh16";
  static constexpr std::string_view kSummary =
      N == 2   ? "binary bounding volume hierarchy"
      : N == 4 ? "4-wide bounding volume hierarchy, child boxes as structure of arrays"
      : N == 8 ? "8-wide bounding volume hierarchy, child boxes as structure of arrays"
               : "16-wide bounding volume hierarchy, child boxes as structure of arrays";
  static constexpr std::size_t kGranule = 32;
  using Node = bvh::Node<N>;

  static void write(Node& node, const Bounds3f* boxes, const NodeReference* references, unsigned count) noexcept {
    for (unsigned i = 0; i < unsigned(N); ++i) {
      const Bounds3f box = i < count ? boxes[i] : Bounds3f{};
      for (int axis = 0; axis < 3; ++axis)
        node.planes[2 * axis][i] = box.lower[axis], node.planes[2 * axis + 1][i] = box.upper[axis];
      node.child[i] = i < count ? references[i] : 0;
    }
  }
  static unsigned read(const Node& node, Bounds3f* boxes, NodeReference* references) noexcept {
    unsigned i = 0;
    for (; i < unsigned(N) && node.planes[0][i] <= node.planes[1][i]; ++i) {
      boxes[i] = {{node.planes[0][i], node.planes[2][i], node.planes[4][i]},
                  {node.planes[1][i], node.planes[3][i], node.planes[5][i]}};
      references[i] = node.child[i];
    }
    return i;
  }
};

template <int N>
using Bvh = WideBvh<SoaNodes<N>>;
using Bvh2 = Bvh<2>;
using Bvh4 = Bvh<4>;
using Bvh8 = Bvh<8>;
using Bvh16 = Bvh<16>;
using Structures = TypeList<Bvh2, Bvh4, Bvh8, Bvh16>;

}  // namespace arboretum::bvh
