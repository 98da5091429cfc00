// The stack of a ray that goes depth first through a wide BVH, children near to far.
//
// A stack entry is 64 bits: the entry distance's bits above, the child reference below, so that one comparison orders
// two entries (bits of t >= 0 order as integers). A popped entry that starts beyond the nearest hit is dropped.
#pragma once

#include "traversal/batch_stack.h"
#include "traversal/prefetch.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

using StackEntry = std::uint64_t;

[[nodiscard]] ARBORETUM_INLINE StackEntry stack_entry(std::uint32_t distance_bits, bvh::NodeReference child) {
  return std::uint64_t(distance_bits) << 32 | child;
}

/// Orders two entries so that the nearer stands in `b`, on top.
ARBORETUM_INLINE void sort_pair(StackEntry& a, StackEntry& b) {
  const StackEntry far = a < b ? b : a, near = a < b ? a : b;
  a = far, b = near;
}

/// Of every child that waits on the stack, so many cache lines are asked for at once (docs/performance.md).
inline constexpr int kPrefetchLines = 5;

/// Puts the children that `hit` names, two or more, on the stack, far to near, and takes the nearest off again as the
/// result. Bit i of `hit` is the child with reference child[i * Stride], entered at the distance with the bits key[i].
template <int Stride = 1>
ARBORETUM_INLINE bvh::NodeReference push_children(const std::byte* base, const bvh::NodeReference* child,
                                                  const std::uint32_t* key, unsigned hit, StackEntry*& top) {
  const auto next = [&] {
    const int i = __builtin_ctz(hit);
    hit &= hit - 1;
    const bvh::NodeReference reference = child[i * Stride];
    prefetch_lines<kPrefetchLines>(base + bvh::offset_of(reference));
    return stack_entry(key[i], reference);
  };
  StackEntry a = next(), b = next();
  sort_pair(a, b);
  if (__builtin_expect(hit == 0, 1)) {
    *top++ = a;
    return bvh::NodeReference(b);
  }
  StackEntry c = next();
  sort_pair(b, c), sort_pair(a, b);
  if (hit == 0) {
    top[0] = a, top[1] = b;
    top += 2;
    return bvh::NodeReference(c);
  }
  StackEntry d = next();
  sort_pair(c, d), sort_pair(b, c), sort_pair(a, b);  // d is put in its place among a >= b >= c
  StackEntry* const bottom = top;
  top[0] = a, top[1] = b, top[2] = c, top[3] = d;
  top += 4;
  while (hit) {  // five or more: insertion
    const StackEntry e = next();
    StackEntry* p = top++;
    for (; p != bottom && p[-1] < e; --p) *p = p[-1];
    *p = e;
  }
  return bvh::NodeReference(*--top);
}

/// The same without an order: the last child is taken, the others wait.
template <int Stride = 1>
ARBORETUM_INLINE bvh::NodeReference push_unordered(const std::byte* base, const bvh::NodeReference* child, unsigned hit,
                                                   StackEntry*& top) {
  for (; hit & (hit - 1); hit &= hit - 1) {
    const bvh::NodeReference reference = child[__builtin_ctz(hit) * Stride];
    prefetch_lines<kPrefetchLines>(base + bvh::offset_of(reference));
    *top++ = reference;
  }
  return child[__builtin_ctz(hit) * Stride];
}

#if ARBORETUM_TARGET != ARBORETUM_TARGET_SCALAR
/// The references of W children, which lie `Stride` places apart, in a register, or two.
template <int Stride, int W>
ARBORETUM_INLINE vi<W> references(const bvh::NodeReference* child) {
  if constexpr (Stride == 1) {
    return vi<W>::load(child);
  } else {
    static_assert(W == 4);
    return vi<4>(_mm_setr_epi32(int(child[0]), int(child[Stride]), int(child[2 * Stride]), int(child[3 * Stride])));
  }
}
#endif

using TraversalStack = BatchStack<StackEntry, 1024>;

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
