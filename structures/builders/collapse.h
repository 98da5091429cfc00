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

/// The wide children of a binary node, at most kMaxBranching.
struct Slots {
  unsigned size = 0;
  std::uint32_t node[kMaxBranching];
};

/// A node or leaf of a wide tree.
struct WideNode {
  Bounds3f box;
  std::uint32_t first;  ///< of a node's children in WideTree::nodes; of a leaf's references in WideTree::primitives
  std::uint32_t count;  ///< references below
  std::uint64_t bytes : 48;    ///< of the subtree: its own, in granules, and all below
  std::uint64_t children : 6;  ///< 0 for a leaf
  std::uint64_t blocks : 9;    ///< of a leaf
  std::uint64_t repeats : 1;   ///< the leaf's references may name a primitive more than once

  [[nodiscard]] bool is_leaf() const noexcept { return children == 0; }
};
static_assert(sizeof(WideNode) == 40);

/// What of a binary tree becomes of a wide one: all that has to be known to write it. Node 0 is the root, children
/// stand next to each other, the ones of which the SAH expects the least work last: there any hit looks first.
struct WideTree {
  ReservedArray<WideNode> nodes;
  MeteredVector<std::uint32_t> primitives;

  [[nodiscard]] std::span<const WideNode> children(const WideNode& node) const noexcept {
    return {nodes.data() + node.first, node.children};
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
  /// The children of the wide node made from `node`, which is not a leaf.
  [[nodiscard]] Slots children(std::uint32_t node) const noexcept;
  /// Blocks of the leaf made from `node`, which is_leaf().
  [[nodiscard]] unsigned blocks(std::uint32_t node) const noexcept { return blocks_for(plan_[node].references); }
  /// Writes the wide tree's nodes.
  void write(ReservedArray<WideNode>& out) const;
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
  void expand(std::uint32_t node, unsigned slots, Slots& out) const noexcept;
  void expand_children(std::uint32_t node, unsigned slots, Slots& out) const noexcept;

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
