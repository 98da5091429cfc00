// Collapse: a binary tree into a tree of branching factor N (Wald, Benthin, Boulos 2008), greedily by area or with the
// least SAH cost by dynamic programming (as Aila and Karras 2010 choose treelets; Ylitie, Karras, Laine 2017 for wide BVHs).
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

struct CollapseSettings {
  unsigned branching = 8;
  unsigned block_width = 4;      ///< triangles a leaf block
  unsigned max_leaf_blocks = 4;
  float traversal_cost = 1.0f;
  float intersection_cost = 1.0f;
  bool optimal = true;
  std::size_t node_bytes = 0, block_bytes = 0;  ///< what a wide node and a leaf block take
  std::size_t granule = 32;  ///< nodes and leaves take multiples of so many bytes
};

/// Room for the primitives of a leaf that is merged from a subtree.
using LeafPrimitives = std::array<std::uint32_t, kMaxMergedReferences>;

/// The wide children of a binary node, at most kMaxBranching.
struct Slots {
  unsigned size = 0;
  std::uint32_t node[kMaxBranching];
};

/// Decides which binary nodes become wide nodes and which leaves, and how many bytes each such subtree takes.
class Collapse {
 public:
  Collapse(const BinaryTree& tree, const CollapseSettings& settings);

  /// Whether the subtree at `node` becomes one leaf.
  [[nodiscard]] bool is_leaf(std::uint32_t node) const noexcept { return plan_[node].leaf; }
  /// The children of the wide node made from `node`, which is not a leaf.
  [[nodiscard]] Slots children(std::uint32_t node) const noexcept;
  /// Bytes of the subtree at a node that is_leaf() or is some children()'s: its own, in granules, and all below.
  [[nodiscard]] std::uint64_t bytes(std::uint32_t node) const noexcept { return plan_[node].bytes; }
  /// Blocks of the leaf made from `node`, which is_leaf().
  [[nodiscard]] unsigned blocks(std::uint32_t node) const noexcept { return blocks_for(plan_[node].references); }
  /// The primitives of that leaf, none of them twice; in `room`, or in the tree where it holds them so.
  [[nodiscard]] std::span<const std::uint32_t> primitives(std::uint32_t node, LeafPrimitives& room) const noexcept;

 private:
  struct Plan {
    std::uint64_t bytes : 48;
    std::uint64_t references : 10;  ///< of a leaf: without those that repeat
    std::uint64_t slots : 5;        ///< optimal: how many children the wide node made from this one has
    std::uint64_t leaf : 1;
  };
  struct Costs;
  struct Shares;
  void optimise(std::uint32_t node, Costs& out);
  void choose_leaves(std::uint32_t node);
  std::uint64_t measure(std::uint32_t node);
  void plan_leaf(std::uint32_t node);
  [[nodiscard]] unsigned blocks_for(unsigned references) const noexcept { return (references + settings_.block_width - 1) / settings_.block_width; }
  void expand(std::uint32_t node, unsigned slots, Slots& out) const noexcept;
  void expand_children(std::uint32_t node, unsigned slots, Slots& out) const noexcept;

  const BinaryTree& tree_;
  const CollapseSettings settings_;
  MeteredVector<Plan> plan_;
  /// [node * branching + k - 1], k >= 2: below, the left child's share of k slots less one; above (4 bits), how many of at most
  /// k slots to use, less one.
  MeteredVector<std::uint8_t> choice_;
};

}  // namespace arboretum
