// One ray through a tree of N-wide nodes, near to far, whatever the boxes and the leaves are: what trees of instances and of
// moving boxes share. The loop is that of bvh_single.h, which stays by itself because its leaves are known.
#pragma once

#include "structures/bvh/bvh_single.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Nodes are named as in structures/bvh/bvh.h; their child references stand `ChildOffset` bytes behind the node.
/// `box.test(node, tnear, tfar, entry)` as BoxLanes has it. `leaf(reference)` returns true to stop, and may lower `nearest`,
/// beyond which nothing is visited. `counted(node, hit)` is called at each node.
template <int N, std::size_t ChildOffset, class Box, class Leaf, class Counted>
ARBORETUM_INLINE bool walk_bvh(const std::byte* base, bvh::NodeReference root, const Box& box, float tnear, const float& nearest,
                               StackEntry* stack, const Leaf& leaf, const Counted& counted) {
  constexpr int W = N < 4 ? 4 : N;
  const vf<W> near(tnear);
  vf<W> far(nearest);
  StackEntry* top = stack;
  bvh::NodeReference reference = root;
  for (;;) {
    while (!bvh::is_leaf(reference)) {
      const std::byte* node = base + bvh::offset_of(reference);
      vf<W> entry;
      const unsigned hit = box.test(node, near, far, entry);
      const auto* child = reinterpret_cast<const bvh::NodeReference*>(node + ChildOffset);
      counted(node, hit);
      if (hit == 0) goto pop;
      if ((hit & (hit - 1)) == 0) {
        reference = child[__builtin_ctz(hit)];
        continue;
      }
      alignas(64) std::uint32_t key[W];
      entry.store(key);
      reference = push_children(base, child, key, hit, top);
    }
    if (leaf(reference)) return true;
    far = vf<W>(nearest);
  pop:
    for (;;) {
      if (top == stack) return false;
      const StackEntry e = *--top;
      reference = bvh::NodeReference(e);
      if (__builtin_bit_cast(float, std::uint32_t(e >> 32)) <= nearest) break;
    }
  }
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
