// One ray through a wide BVH, depth first, children near to far; closest hit and any hit.
//
// A stack entry is 64 bits: the entry distance's bits above, the child reference below, so that one comparison orders
// two entries (bits of t >= 0 order as integers). A popped entry that starts beyond the nearest hit is dropped.
#pragma once

#include "intersectors/leaf_block.h"
#include "traversal/box_test.h"

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

/// Puts the children that `hit` names on the stack, far to near, and takes the nearest off again as the result.
template <int N>
ARBORETUM_INLINE bvh::NodeReference push_children(const std::byte* base, const bvh::NodeReference* child, const std::uint32_t* key,
                                                  unsigned hit, StackEntry*& top) {
  const auto next = [&] {
    const int i = __builtin_ctz(hit);
    hit &= hit - 1;
    const auto* target = reinterpret_cast<const char*>(base + bvh::offset_of(child[i]));
    for (int line = 0; line < kPrefetchLines; ++line) _mm_prefetch(target + 64 * line, _MM_HINT_T0);
    return stack_entry(key[i], child[i]);
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

template <int N, class Block, class Intersector, bool Padded, class Counting>
struct SingleRay {
  static constexpr int W = N < 4 ? 4 : N;
  using F = vf<W>;

  template <bool AnyHit>
  static ARBORETUM_INLINE bool trace(const std::byte* base, bvh::NodeReference root, float max_coordinate, const Vec3f* vertices,
                                     StackEntry* stack, const Ray& ray, NearestHit& best, Counting counting) {
    const BoxLanes<N, Padded> box(BoxRay<N, Padded>(ray, max_coordinate));
    const typename Intersector::RayData data(ray);
    const F tnear(first_distance(ray));
    F tfar(best.t);
    StackEntry* top = stack;
    bvh::NodeReference reference = root;
    for (;;) {
      while (!bvh::is_leaf(reference)) {
        const std::byte* node = base + bvh::offset_of(reference);
        F entry;
        const unsigned hit = box.test(node, tnear, tfar, entry);
        const auto* child = reinterpret_cast<const bvh::NodeReference*>(node + 6 * N * sizeof(float));
        if constexpr (Counting::kCounting) count_node(counting, node, hit);
        if (hit == 0) goto pop;
        if ((hit & (hit - 1)) == 0) {
          reference = child[__builtin_ctz(hit)];
          continue;
        }
        {
          alignas(64) std::uint32_t key[W];
          entry.store(key);
          reference = push_children<N>(base, child, key, hit, top);
        }
      }
      {
        const auto* block = reinterpret_cast<const Block*>(base + bvh::offset_of(reference));
        const Block* const end = block + bvh::block_count(reference);
        if constexpr (Counting::kCounting) count_leaf(counting, block, end);
        bool changed = false;
        do {
          if constexpr (AnyHit) {
            if (any_hit_block<Intersector>(data, readable(*block, vertices), ray.tnear, ray.tfar)) return true;
          } else {
            changed |= closest_hit_block<Intersector>(data, readable(*block, vertices), ray.tnear, best);
          }
        } while (++block != end);
        if constexpr (!AnyHit) {
          if (changed) tfar = F(best.t);
        }
      }
    pop:
      for (;;) {
        if (top == stack) return false;
        const StackEntry e = *--top;
        reference = bvh::NodeReference(e);
        if (AnyHit || __builtin_bit_cast(float, std::uint32_t(e >> 32)) <= best.t) break;
      }
    }
  }

  static void count_node(Counting& counting, const std::byte* node, unsigned hit) {
    ++counting.counters.nodes;
    const auto* lower = reinterpret_cast<const float*>(node);
    for (int i = 0; i < N; ++i) counting.counters.boxes += lower[i] <= lower[N + i], counting.counters.lanes_active += lower[i] <= lower[N + i];
    counting.counters.boxes_hit += unsigned(__builtin_popcount(hit));
    counting.counters.lanes += W;
  }
  static void count_leaf(Counting& counting, const Block* block, const Block* end) {
    ++counting.counters.leaves;
    for (; block != end; ++block) {
      ++counting.counters.blocks;
      counting.counters.lanes += Block::kWidth;
      counting.counters.triangles += unsigned(triangles_in(*block)), counting.counters.lanes_active += unsigned(triangles_in(*block));
    }
  }
};

/// A stack for one batch: on this frame while the tree is shallow, on the heap when it is deeper.
class TraversalStack {
 public:
  explicit TraversalStack(std::size_t entries) {
    if (entries > kInline) heap_.resize(entries), data_ = heap_.data();
  }
  TraversalStack(const TraversalStack&) = delete;
  TraversalStack& operator=(const TraversalStack&) = delete;
  [[nodiscard]] StackEntry* data() noexcept { return data_; }

 private:
  static constexpr std::size_t kInline = 1024;
  StackEntry inline_[kInline];
  std::vector<StackEntry> heap_;
  StackEntry* data_ = inline_;
};

template <int N, class Block, class Intersector, bool Padded, class Counting>
void bvh_closest_hit(const Accel& accel, RayBatch rays, std::span<Hit> hits, Counters* counters) {
  const auto& tree = static_cast<const bvh::Bvh<N>&>(accel);
  const std::byte* const base = tree.base();
  const bvh::NodeReference root = tree.root();
  const float max_coordinate = tree.max_coordinate();
  TraversalStack stack(tree.stack_entries());
  Counting counting(counters);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Ray& ray = rays[i];
    NearestHit best{ray.tfar};
    if (is_valid_in_lanes(ray)) SingleRay<N, Block, Intersector, Padded, Counting>::template trace<false>(base, root, max_coordinate, tree.vertices(), stack.data(), ray, best, counting);
    hits[i] = to_hit(best);
  }
  if constexpr (Counting::kCounting) counting.counters.rays += rays.size();
}

template <int N, class Block, class Intersector, bool Padded, class Counting>
void bvh_any_hit(const Accel& accel, RayBatch rays, std::span<std::uint8_t> occluded, Counters* counters) {
  const auto& tree = static_cast<const bvh::Bvh<N>&>(accel);
  const std::byte* const base = tree.base();
  const bvh::NodeReference root = tree.root();
  const float max_coordinate = tree.max_coordinate();
  TraversalStack stack(tree.stack_entries());
  Counting counting(counters);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Ray& ray = rays[i];
    NearestHit best{ray.tfar};
    occluded[i] = is_valid_in_lanes(ray) && SingleRay<N, Block, Intersector, Padded, Counting>::template trace<true>(base, root, max_coordinate, tree.vertices(), stack.data(), ray, best, counting);
  }
  if constexpr (Counting::kCounting) counting.counters.rays += rays.size();
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
