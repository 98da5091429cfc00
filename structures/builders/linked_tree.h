// LinkedTree: a binary tree whose nodes stand anywhere, as bottom-up builders and optimisers keep it; lay_out() makes a
// BinaryTree.
#pragma once

#include <cstdint>

#include "core/bounds.h"
#include "core/memory_meter.h"
#include "structures/builders/binary_tree.h"

namespace arboretum {

/// An inner node names two children; a leaf its references, primitives[first(), first() + size()).
struct alignas(32) LinkedNode {
  static constexpr std::uint32_t kLeaf = 1u << 31;
  Vec3f lower;
  std::uint32_t left;
  Vec3f upper;
  std::uint32_t right;

  [[nodiscard]] static LinkedNode leaf(const Bounds3f& box, std::uint32_t first, std::uint32_t size) noexcept {
    return {box.lower, first | kLeaf, box.upper, size};
  }
  [[nodiscard]] static LinkedNode inner(const Bounds3f& box, std::uint32_t left, std::uint32_t right) noexcept {
    return {box.lower, left, box.upper, right};
  }
  [[nodiscard]] bool is_leaf() const noexcept { return (left & kLeaf) != 0; }
  [[nodiscard]] std::uint32_t first() const noexcept { return left & ~kLeaf; }
  [[nodiscard]] std::uint32_t size() const noexcept { return right; }
  [[nodiscard]] Bounds3f box() const noexcept { return {lower, upper}; }
};
static_assert(sizeof(LinkedNode) == 32);

struct LinkedTree {
  MeteredVector<LinkedNode> nodes;
  std::uint32_t root = 0;
  MeteredVector<std::uint32_t> primitives;  ///< fewer than 2^30, or nodes would not be numbered in 31 bits
  bool duplicates = false;                  ///< a primitive may be referenced by several leaves
};

/// The same tree with children next to each other and references in order of the leaves; a subtree of at most
/// `leaf_width` references becomes one leaf, unless it might name a primitive twice. The result depends on the tree
/// alone. Runs in the caller's TBB arena. The tree is not empty.
[[nodiscard]] BinaryTree lay_out(const LinkedTree& tree, unsigned leaf_width);

/// The other way: nodes keep their numbers. Throws UserError where those take more than 31 bits.
[[nodiscard]] LinkedTree to_linked(const BinaryTree& tree);

}  // namespace arboretum
