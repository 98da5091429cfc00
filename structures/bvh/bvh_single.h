// One ray through a wide BVH, depth first, children near to far; closest hit and any hit, whatever the format of its nodes.
//
// `Nodes` is one ray and how it meets the nodes of a format:
//   Nodes(ray, max_coordinate): the ray's constants, its interval [tnear, tfar] among them;
//   kSlots: children that a node has room for; W: lanes of a test; test(node, entry): the children whose box the ray meets within its interval, as bits, and in those lanes of
//     `entry` the distances at which it enters them, at least tnear;
//   children(node): an array in which bit i's child has its reference at [i * kStride];
//   shorten(tfar): the interval ends earlier; boxes(node): how many children there are.
#pragma once

#include "intersectors/leaf_block.h"
#include "structures/bvh/traversal_stack.h"
#include "traversal/box_test.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Nodes of bvh::SoaNodes<N>.
template <int N, bool Padded>
struct SoaNodeTest {
  static constexpr int W = N < 4 ? 4 : N, kSlots = W, kStride = 1;
  using F = vf<W>;
  BoxLanes<N, Padded> box;
  F tnear, tfar;

  ARBORETUM_INLINE SoaNodeTest(const Ray& ray, float max_coordinate)
      : box(BoxRay<N, Padded>(ray, max_coordinate)), tnear(first_distance(ray)), tfar(ray.tfar) {}
  ARBORETUM_INLINE unsigned test(const std::byte* node, F& entry) const { return box.test(node, tnear, tfar, entry); }
  ARBORETUM_INLINE void shorten(float t) { tfar = F(t); }
  static ARBORETUM_INLINE const bvh::NodeReference* children(const std::byte* node) {
    return reinterpret_cast<const bvh::NodeReference*>(node + 6 * N * sizeof(float));
  }
  static unsigned boxes(const std::byte* node) {
    const auto* lower = reinterpret_cast<const float*>(node);
    unsigned count = 0;
    for (int i = 0; i < N; ++i) count += lower[i] <= lower[N + i];
    return count;
  }
};

template <class Nodes, class Block, class Intersector, class Counting>
struct SingleRay {
  template <bool AnyHit>
  static ARBORETUM_INLINE bool trace(const std::byte* base, bvh::NodeReference root, float max_coordinate, const Vec3f* vertices,
                                     StackEntry* stack, const Ray& ray, NearestHit& best, Counting counting) {
    Nodes nodes(ray, max_coordinate);
    const typename Intersector::RayData data(ray);
    StackEntry* top = stack;
    bvh::NodeReference reference = root;
    for (;;) {
      while (!bvh::is_leaf(reference)) {
        const std::byte* node = base + bvh::offset_of(reference);
        vf<Nodes::W> entry;
        const unsigned hit = nodes.test(node, entry);
        if constexpr (Counting::kCounting) count_node(counting, node, hit);
        if (hit == 0) goto pop;
        const bvh::NodeReference* child = Nodes::children(node);
        if ((hit & (hit - 1)) == 0) {
          reference = child[__builtin_ctz(hit) * Nodes::kStride];
          continue;
        }
        {
          alignas(64) std::uint32_t key[Nodes::W];
          entry.store(key);
          reference = push_children<Nodes::kStride>(base, child, key, hit, top);
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
          if (changed) nodes.shorten(best.t);
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
    const unsigned boxes = Nodes::boxes(node);
    ++counting.counters.nodes;
    counting.counters.boxes += boxes, counting.counters.lanes_active += boxes;
    counting.counters.boxes_hit += unsigned(__builtin_popcount(hit));
    counting.counters.lanes += Nodes::kSlots;
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

/// Calls `answer(i, hit, best)` for each ray: whether anything was hit (any hit), or the nearest (closest hit).
template <bool AnyHit, class Nodes, class Block, class Intersector, class Counting, class Answer>
ARBORETUM_INLINE void trace_single_rays(const Accel& accel, RayBatch rays, Counters* counters, Answer answer) {
  const auto& tree = static_cast<const bvh::BvhBase&>(accel);
  const std::byte* const base = tree.base();
  const bvh::NodeReference root = tree.root();
  const float max_coordinate = tree.max_coordinate();
  TraversalStack stack(tree.stack_entries());
  Counting counting(counters);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Ray& ray = rays[i];
    NearestHit best{ray.tfar};
    const bool hit = is_valid_in_lanes(ray) && SingleRay<Nodes, Block, Intersector, Counting>::template trace<AnyHit>(
                                                   base, root, max_coordinate, tree.vertices(), stack.data(), ray, best, counting);
    answer(i, hit, best);
  }
  if constexpr (Counting::kCounting) counting.counters.rays += rays.size();
}

template <class Nodes, class Block, class Intersector, class Counting>
void bvh_closest_hit(const Accel& accel, RayBatch rays, std::span<Hit> hits, Counters* counters) {
  trace_single_rays<false, Nodes, Block, Intersector, Counting>(
      accel, rays, counters, [&](std::size_t i, bool, const NearestHit& best) { hits[i] = to_hit(best); });
}

template <class Nodes, class Block, class Intersector, class Counting>
void bvh_any_hit(const Accel& accel, RayBatch rays, std::span<std::uint8_t> occluded, Counters* counters) {
  trace_single_rays<true, Nodes, Block, Intersector, Counting>(
      accel, rays, counters, [&](std::size_t i, bool hit, const NearestHit&) { occluded[i] = hit; });
}

/// Makes table rows (traversal/kernel_rows.h) of single rays through nodes that `Nodes<Padded>` tests.
template <template <bool> class Nodes>
struct SingleRayKernels {
  template <class Block, class Intersector, bool Padded>
  struct Maker {
    static void closest_hit(const Accel& a, RayBatch r, std::span<Hit> h, Counters* c) { bvh_closest_hit<Nodes<Padded>, Block, Intersector, NoCounters>(a, r, h, c); }
    static void any_hit(const Accel& a, RayBatch r, std::span<std::uint8_t> h, Counters* c) { bvh_any_hit<Nodes<Padded>, Block, Intersector, NoCounters>(a, r, h, c); }
    static void count_closest_hit(const Accel& a, RayBatch r, std::span<Hit> h, Counters* c) { bvh_closest_hit<Nodes<Padded>, Block, Intersector, WithCounters>(a, r, h, c); }
    static void count_any_hit(const Accel& a, RayBatch r, std::span<std::uint8_t> h, Counters* c) { bvh_any_hit<Nodes<Padded>, Block, Intersector, WithCounters>(a, r, h, c); }
  };
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
