// Bounding interval hierarchy (Waechter and Keller, EGSR 2006): the hybrid between kd-tree and BVH. An inner
// node has an axis and two planes as a kd-tree's has one: where its left child ends and where its right child
// begins. Each triangle stands in one leaf, as in a BVH, and memory is known beforehand; a ray keeps an
// interval of t and computes two distances a node, as in a kd-tree.
//
// Where we differ: the paper splits at regular planes, top down. Here any builder of binary trees makes the
// hierarchy (structures/builders/); a node takes the axis whose two planes leave the least expected cost
// below, and where the box of a subtree is so much smaller than what the planes above leave that testing for
// it pays, nodes with one child clip to it ("bounding interval" nodes, section 2.3's empty space as in the
// B-KD trees of Woop, Marmitt, Slusallek 2006).
#pragma once

#include <bit>
#include <cstdint>

#include "core/memory_meter.h"
#include "core/type_list.h"
#include "structures/accel.h"
#include "structures/leaves/leaf_lists.h"

namespace arboretum::bih {

/// 12 bytes; the two children of a node stand next to each other. By its kind,
///
/// a pair on axis k: clip[0] is the left child's upper face, clip[1] the right child's lower face, first the left
/// child;
///
/// a clip on axis k: clip[0] and clip[1] are the lower and the upper face of the one child, first is that child;
///
/// a leaf: clip[0] holds the bits of its LeafCode.
struct Node {
  enum Kind : std::uint32_t { kPair = 0, kClip = 4, kLeaf = 3 };  ///< kPair and kClip plus the axis
  float clip[2];
  std::uint32_t reference;  ///< kind in the low three bits, first above
  [[nodiscard]] std::uint32_t kind() const noexcept { return reference & 7u; }
  [[nodiscard]] std::uint32_t first() const noexcept { return reference >> 3; }
  [[nodiscard]] LeafCode code() const noexcept { return std::bit_cast<LeafCode>(clip[0]); }
};
static_assert(sizeof(Node) == 12);

class Bih final : public Accel {
 public:
  static constexpr std::string_view kName = "bih";
  [[nodiscard]] static const StructureInfo& static_info();
  [[nodiscard]] const StructureInfo& info() const noexcept override { return static_info(); }
  /// Throws UserError for parameters out of range, 2^29 nodes or 2^28 leaf blocks.
  void build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) override;
  /// Boxes are what the planes above leave: where a ray comes along. The scene's box is the root's.
  [[nodiscard]] bool visit(StructureVisitor& visitor) const override;
  void archive(Archive& archive) override;
  [[nodiscard]] std::size_t bytes() const noexcept override { return nodes_.size() * sizeof(Node) + leaves_.bytes(); }

  [[nodiscard]] const Node* nodes() const noexcept { return nodes_.data(); }  ///< the root first
  [[nodiscard]] const Bounds3f& bounds() const noexcept { return bounds_; }
  [[nodiscard]] const LeafStore& leaves() const noexcept { return leaves_; }
  /// What padded intervals scale their pad with (structures/box_pads.h).
  [[nodiscard]] float max_coordinate() const noexcept { return max_coordinate_; }
  /// Most children that can wait while a ray goes down.
  [[nodiscard]] std::size_t stack_entries() const noexcept { return stack_entries_; }

 private:
  MeteredVector<Node> nodes_;
  Bounds3f bounds_;
  LeafStore leaves_;
  float max_coordinate_ = 0.0f;
  std::size_t stack_entries_ = 1;
};

using Structures = TypeList<Bih>;

}  // namespace arboretum::bih
