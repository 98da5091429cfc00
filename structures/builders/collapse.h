// Collapse: a binary tree into a tree of branching factor N (Wald, Benthin, Boulos 2008), greedily by area or with the
// least SAH cost by dynamic programming (as Aila and Karras 2010 choose treelets; Ylitie, Karras, Laine 2017 for wide
// BVHs).
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "structures/accel.h"
#include "structures/builders/binary_tree.h"

namespace arboretum {

inline constexpr unsigned kMaxBranching = 16;
/// A subtree of more references does not become one leaf.
inline constexpr unsigned kMaxMergedReferences = 256;
/// What a leaf costs beside its blocks, in blocks. SAH knows none of it; where boxes overlap (`generate: needles`) rays
/// lose by trees that open every leaf.
inline constexpr float kLeafVisit = 0.25f;

struct CollapseSettings {
  unsigned branching = 8;
  unsigned block_width = 4;  ///< triangles a leaf block
  unsigned max_leaf_blocks = 4;
  float traversal_cost = 1.0f;
  float intersection_cost = 1.0f;
  bool optimal = true;
  std::size_t node_bytes = 0, block_bytes = 0;  ///< what a wide node and a leaf block take
  std::size_t granule = 32;                     ///< nodes and leaves take multiples of so many bytes
};

/// Room for the primitives of a leaf that is merged from a subtree.
using LeafPrimitives = std::array<std::uint32_t, kMaxMergedReferences>;
/// At most kMaxMergedReferences of them without repetitions, sorted, in `room`.
[[nodiscard]] std::span<const std::uint32_t> distinct(std::span<const std::uint32_t> references,
                                                      LeafPrimitives& room) noexcept;

/// The wide children of a binary node, at most kMaxBranching, and where the references of each begin.
struct Slots {
  unsigned size = 0;
  std::uint32_t node[kMaxBranching], begin[kMaxBranching];
};

/// A node or leaf of a wide tree, in 32 bytes: trees of millions of them are held beside what is made of them.
class WideNode {
 public:
  WideNode() = default;
  [[nodiscard]] static WideNode leaf(const Bounds3f& box, std::uint32_t first, unsigned references, unsigned blocks,
                                     bool repeats) noexcept {
    return {box, first, 0, repeats, references | blocks << kReferenceBits};
  }
  [[nodiscard]] static WideNode inner(const Bounds3f& box, std::uint32_t first, unsigned children, bool large,
                                      std::uint64_t granules) noexcept {
    return {box, first, children, large, granules};
  }

  Bounds3f box;

  [[nodiscard]] bool is_leaf() const noexcept { return children_ == 0; }
  /// Of a node's children in WideTree::nodes; of a leaf's references in WideTree::primitives.
  [[nodiscard]] std::uint32_t first() const noexcept { return first_; }
  [[nodiscard]] unsigned children() const noexcept { return children_; }
  /// Of a node: more references below than one task takes.
  [[nodiscard]] bool is_large() const noexcept { return mark_ != 0; }
  /// Of a node: what it takes with all below, where that is less than 2^28 granules.
  [[nodiscard]] std::uint64_t granules() const noexcept { return size_; }
  [[nodiscard]] unsigned references() const noexcept { return size_ & ((1u << kReferenceBits) - 1); }
  [[nodiscard]] unsigned blocks() const noexcept { return size_ >> kReferenceBits; }
  /// Of a leaf: its references may name a primitive more than once.
  [[nodiscard]] bool repeats() const noexcept { return mark_ != 0; }

 private:
  static constexpr unsigned kReferenceBits = 9;
  static_assert(kMaxMergedReferences < 1u << kReferenceBits);
  WideNode(const Bounds3f& b, std::uint32_t first, unsigned children, bool mark, std::uint64_t size) noexcept
      : box(b), first_(first & ((1u << 30) - 1)), children_(children & 31u), mark_(mark),
        size_(size & ((1u << 28) - 1)) {}

  std::uint64_t first_ : 30, children_ : 5, mark_ : 1, size_ : 28;
};
static_assert(sizeof(WideNode) == 32);

/// What of a binary tree becomes of a wide one: all that has to be known to write it. Node 0 is the root, children
/// stand next to each other, the ones of which the SAH expects the least work last: there any hit looks first.
struct WideTree {
  ReservedArray<WideNode> nodes;
  MeteredVector<std::uint32_t> primitives;
  bool in_blocks = false;      ///< as of the binary tree
  std::uint64_t granules = 0;  ///< of the whole tree, but for leaves that are filled

  [[nodiscard]] std::span<const WideNode> children(const WideNode& node) const noexcept {
    return {nodes.data() + node.first(), node.children()};
  }
  /// The primitives of a leaf, none of them twice; in `room`, or in the tree where it holds them so.
  [[nodiscard]] std::span<const std::uint32_t> leaf_primitives(const WideNode& leaf,
                                                               LeafPrimitives& room) const noexcept;
};

/// The wide tree, and none of the binary one any more.
[[nodiscard]] WideTree collapse(BinaryTree&& tree, const CollapseSettings& settings);

/// The SAH cost of the tree that collapse() would make of it, times the root's area.
[[nodiscard]] double sah_cost(const BinaryTree& tree, const CollapseSettings& settings);

/// Decides which binary nodes become wide nodes and which leaves.
class Collapse {
 public:
  Collapse(const BinaryTree& tree, const CollapseSettings& settings);

  /// Whether the subtree at `node` becomes one leaf.
  [[nodiscard]] bool is_leaf(std::uint32_t node) const noexcept { return plan_[node].leaf; }
  /// The children of the wide node made from `node`, which is not a leaf and whose references begin at `begin`.
  [[nodiscard]] Slots children(std::uint32_t node, std::uint32_t begin) const noexcept;
  /// Blocks of the leaf made from `node`, which is_leaf().
  [[nodiscard]] unsigned blocks(std::uint32_t node) const noexcept { return blocks_for(plan_[node].references); }
  /// Writes the wide tree's nodes; returns how many granules all take. Does not look at BinaryTree::first.
  std::uint64_t write(ReservedArray<WideNode>& out) const;
  /// The SAH cost of what becomes of the subtree at `node`, times the root's area.
  [[nodiscard]] double cost(std::uint32_t node) const;

 private:
  struct Plan {
    std::uint16_t references : 10;  ///< of a leaf: without those that repeat
    std::uint16_t slots : 5;        ///< optimal: how many children the wide node made from this one has
    std::uint16_t leaf : 1;
  };
  struct Costs;
  struct Shares;
  class Writer;
  void optimise(std::uint32_t node, Costs& out);
  void choose_leaves(std::uint32_t node);
  [[nodiscard]] unsigned leaf_references(std::uint32_t node) const noexcept;
  [[nodiscard]] unsigned blocks_for(unsigned references) const noexcept {
    return (references + settings_.block_width - 1) / settings_.block_width;
  }
  void expand(std::uint32_t node, std::uint32_t begin, unsigned slots, Slots& out) const noexcept;
  void expand_children(std::uint32_t node, std::uint32_t begin, unsigned slots, Slots& out) const noexcept;
  /// Where the references of a child begin whose left neighbour is `left`.
  [[nodiscard]] std::uint32_t begin_after(std::uint32_t left, std::uint32_t begin) const noexcept {
    return begin + tree_.nodes[left].count;
  }

  /// Of an inner node: one row for each pair of children.
  [[nodiscard]] std::size_t choices_of(std::uint32_t node) const noexcept {
    return std::size_t(tree_.nodes[node].left / 2) * settings_.branching;
  }

  const BinaryTree& tree_;
  const CollapseSettings settings_;
  MeteredVector<Plan> plan_;
  /// [choices_of(node) + k - 1], k >= 2: below, the left child's share of k slots less one; above (4 bits), how many of
  /// at most k slots to use, less one.
  MeteredVector<std::uint8_t> choice_;
};

}  // namespace arboretum
