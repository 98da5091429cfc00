// One ray through a wide BVH, depth first, children near to far; closest hit and any hit, whatever the format of its
// nodes.
//
// `Nodes` is one ray and how it meets the nodes of a format:
//   Nodes(ray, max_coordinate): the ray's constants, its interval [tnear, tfar] among them;
//   Nodes(box, first, last): the same where the constants are known (BoxRay), between two distances;
//     both with the ray's time behind where kMoves says that the nodes' boxes move;
//   kSlots: children that a node has room for; W: lanes of a test;
//   test(node, entry): the children whose box the ray meets within its interval, as bits, and in those lanes of `entry`
//     the distances at which it enters them, at least tnear;
//   children(node): an array in which bit i's child has its reference at [i * kStride];
//   shorten(tfar): the interval ends earlier; boxes(node): how many children there are.
#pragma once

#include "structures/bvh/traversal_stack.h"
#include "traversal/box_test.h"
#include "traversal/single_rays.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Of a format's node tests or packets' nodes: boxes stand where they are at a ray's time.
template <class Nodes>
inline constexpr bool kBoxesMove = requires {
  Nodes::kMoves;
};

/// A ray of that time before the nodes.
template <class Nodes>
ARBORETUM_INLINE Nodes nodes_at(const Ray& ray, float max_coordinate, [[maybe_unused]] float time) {
  if constexpr (kBoxesMove<Nodes>) {
    return Nodes(ray, max_coordinate, time);
  } else {
    return Nodes(ray, max_coordinate);
  }
}

/// What is beside a tree's blocks for its leaves: the mesh's vertices, or what they look for in the tree themselves.
template <class Leaves>
[[nodiscard]] Leaves leaves_of(const bvh::BvhBase& tree, const KernelRow& row) {
  if constexpr (std::is_constructible_v<Leaves, const KernelRow&, const bvh::BvhBase&>) {
    return Leaves(row, tree);
  } else {
    return Leaves(row, tree.vertices());
  }
}

/// Nodes of bvh::SoaNodes<N>.
template <int N, bool Padded>
struct SoaNodeTest {
  static constexpr int W = lanes_for(N), kSlots = W, kStride = 1;
  static constexpr std::size_t kBytes = sizeof(bvh::Node<N>);
  using F = vf<W>;
  BoxLanes<N, Padded> box;
  F tnear, tfar;

  /// `max_coordinate`: the largest of the scene, what padded boxes scale their pad with.
  ARBORETUM_INLINE SoaNodeTest(const Ray& ray, float max_coordinate)
      : SoaNodeTest(BoxRay<N, Padded>(ray, max_coordinate), first_distance(ray), ray.tfar) {}
  ARBORETUM_INLINE SoaNodeTest(const BoxRay<N, Padded>& constants, float first, float last)
      : box(constants), tnear(first), tfar(last) {}
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

template <int N>
struct SoaTests {
  template <bool Padded>
  using Nodes = SoaNodeTest<N, Padded>;
};

/// Depth first, children near to far; for any hit in whatever order, since an occluder may be anywhere.
/// `leaf(reference)` returns true to stop; where it finds a nearer hit it lowers `nearest`, beyond which nothing is
/// visited, and shortens `nodes`. Returns whether it was stopped. `depth`: of the root, where it is counted.
template <bool AnyHit, class Nodes, class Counting, class Leaf>
ARBORETUM_INLINE bool walk_bvh(const std::byte* base, bvh::NodeReference root, Nodes& nodes, StackEntry* stack,
                               const float& nearest, const Counting& counting, const Leaf& leaf,
                               typename Counting::Depth depth = {}) {
  StackEntry* top = stack;
  typename Counting::Depths depths(depth);
  bvh::NodeReference reference = root;
  for (;;) {
    while (!bvh::is_leaf(reference)) {
      const std::byte* node = base + bvh::offset_of(reference);
      vf<Nodes::W> entry;
      const unsigned hit = nodes.test(node, entry);
      if constexpr (Counting::kCounting) {
        const unsigned boxes = Nodes::boxes(node), met = unsigned(__builtin_popcount(hit));
        counting.node(boxes, Nodes::kSlots, met);
        counting.at_depth(depths.current(), Nodes::kSlots, boxes);
        if (met > 1) depths.push(top - stack, top - stack + met - 1);
      }
      if (hit == 0) goto pop;
      depths.descend();
      const bvh::NodeReference* child = Nodes::children(node);
      if ((hit & (hit - 1)) == 0) {
        reference = child[__builtin_ctz(hit) * Nodes::kStride];
        continue;
      }
      if constexpr (AnyHit) {
        reference = push_unordered<Nodes::kStride>(base, child, hit, top);
        continue;
      }
      alignas(64) std::uint32_t key[Nodes::W];
      entry.store(key);
      reference = push_children<Nodes::kStride>(base, child, key, hit, top);
    }
    if (leaf(reference)) return true;
  pop:
    for (;;) {
      if (top == stack) return false;
      const StackEntry e = *--top;
      depths.pop(top - stack);
      reference = bvh::NodeReference(e);
      if (AnyHit || __builtin_bit_cast(float, std::uint32_t(e >> 32)) <= nearest) break;
    }
  }
}

/// The same with the tests of `leaves` and what they keep for the ray, `data`: the search of one ray below `root`. GCC
/// makes a function of the leaf's part unless it is forced not to, and no vector register survives a call
/// (docs/performance.md).
template <bool AnyHit, class Nodes, class Leaves, class Counting>
ARBORETUM_INLINE bool search_bvh(const std::byte* base, bvh::NodeReference root, Nodes& nodes, StackEntry* stack,
                                 const Ray& ray, const Leaves& leaves, typename Leaves::RayData& data, NearestHit& best,
                                 const LeafForm& form, const Counting& counting, typename Counting::Depth depth = {}) {
  const auto leaf = [&](bvh::NodeReference reference) __attribute__((always_inline)) {
    const std::byte* const blocks = base + bvh::offset_of(reference);
    const unsigned count = bvh::block_count(reference);
    if constexpr (AnyHit) return any_hit_in_leaf(leaves, data, form, counting, blocks, count, ray.tnear, ray.tfar);
    if constexpr (Counting::kCounting) counting.leaf(form, blocks, count);
    if (leaves.closest_hit(data, blocks, count, ray.tnear, best)) nodes.shorten(best.t);
    return false;
  };
  return walk_bvh<AnyHit>(base, root, nodes, stack, best.t, counting, leaf, depth);
}

/// Kernels (traversal/single_rays.h) of single rays through nodes that `Nodes<Padded>` tests.
template <template <bool> class Nodes>
struct BvhSingle {
  template <class Leaves, bool Padded, class Counting>
  class Kernel {
    static constexpr bool kLater = kFinishesLater<Leaves>;

   public:
    Kernel(const Accel& accel, const KernelRow& row, Counting counting)
        : Kernel(static_cast<const bvh::BvhBase&>(accel), row, counting,
                 leaves_of<Leaves>(static_cast<const bvh::BvhBase&>(accel), row)) {}

    template <bool AnyHit>
    ARBORETUM_INLINE bool trace(const Ray& ray, float time, NearestHit& best) {
      auto nodes = nodes_at<Nodes<Padded>>(ray, max_coordinate_, time);
      typename Leaves::RayData data = prepare_at(leaves_, ray, time);
      const bool hit =
          search_bvh<AnyHit>(base_, root_, nodes, stack_.data(), ray, leaves_, data, best, form_, counting_);
      if constexpr (!AnyHit && !kLater) leaves_.finish(data, best);
      if constexpr (!AnyHit && kLater) {
        if (best.primitive != NearestHit::kNone) unfinished_.add(ray, data.best);
      }
      return hit;
    }
    ARBORETUM_INLINE void settle(Hit& hit) requires kLater {
      if (hit.is_hit()) unfinished_.settle(hit);
    }
    void finish_all() requires kLater { unfinished_.finish_all(); }

   protected:
    Kernel(const bvh::BvhBase& tree, const KernelRow& row, Counting counting, const Leaves& leaves)
        : base_(tree.base()), root_(tree.root()), max_coordinate_(tree.max_coordinate()), leaves_(leaves),
          form_(*row.tests->form), counting_(counting), stack_(tree.stack_entries()) {}

   private:
    const std::byte* base_;
    bvh::NodeReference root_;
    float max_coordinate_;
    Leaves leaves_;
    const LeafForm& form_;
    Counting counting_;
    TraversalStack stack_;
    [[no_unique_address]] typename UnfinishedOf<Leaves, Hit>::Type unfinished_;
  };
  using Functions = SingleRayFunctions<Kernel>;
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
