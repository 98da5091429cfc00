// BinaryTree: what every BVH builder makes; collapse.h turns it into a tree of any branching factor.
#pragma once

#include <cstdint>

#include "core/bounds.h"
#include "core/memory_meter.h"
#include "core/reserved_array.h"

namespace arboretum {

/// Area of a box's three faces; what builders compare.
[[nodiscard]] inline float half_area(Vec3f lower, Vec3f upper) noexcept {
  const Vec3f d = upper - lower;
  return d.x * d.y + d.y * d.z + d.z * d.x;
}

/// Children stand next to each other. `left` is the first child's index, 0 for a leaf (the root is nobody's child).
struct alignas(32) BinaryNode {
  Vec3f lower;
  std::uint32_t left;
  Vec3f upper;
  std::uint32_t count;  ///< primitive references below

  [[nodiscard]] bool is_leaf() const noexcept { return left == 0; }
  [[nodiscard]] float half_area() const noexcept { return arboretum::half_area(lower, upper); }
};
static_assert(sizeof(BinaryNode) == 32);

/// Node 0 is the root. Slots of `nodes` that no parent names are unused and uninitialised. The references below a node
/// are consecutive in `primitives`; `first` gives where a leaf's begin.
struct BinaryTree {
  ReservedArray<BinaryNode> nodes;
  std::size_t node_count = 0;  ///< indices below this are in use, but for gaps
  MeteredVector<std::uint32_t> primitives;
  ReservedArray<std::uint32_t> first;  ///< one a node; set for leaves
  bool duplicates = false;             ///< a primitive may be referenced by several leaves
  bool in_blocks =
      false;  ///< leaf blocks are filled (structures/leaves/leaf_blocks.h), in the leaves' order:
              ///< references, `count` too, are all their lanes, which neither `primitives` nor `first` holds

  /// Where the references below `node` begin.
  [[nodiscard]] std::uint32_t begin_of(std::uint32_t node) const noexcept {
    while (!nodes[node].is_leaf()) node = nodes[node].left;
    return first[node];
  }
};

}  // namespace arboretum
