// Many rays in flight through a wide BVH of any node format (traversal/queued_rays.h).
//
// The steps of bvh_single.h, one at a time: children in the same order, nearest on top of the ray's own stack; for any
// hit as they stand in the node. What starts beyond a new hit leaves the stack when it is found, so that a step takes
// the top and compares nothing. The bvh::SoaNodes have a loop of their own (bvh_queued.h), whose steps build the ray's
// node test anew from its constants; here a ray keeps the test itself, whatever it consists of.
#pragma once

#include "structures/bvh/bvh_queued.h"
#include "traversal/queued_rays.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// push() (bvh_queued.h), also where references lie `Stride` places apart, and of four children without a branch on
/// AVX2, too.
template <int Stride, bool AnyHit, int W>
ARBORETUM_INLINE void push_children_of(const bvh::NodeReference* child, vf<W> entry, unsigned hit, StackEntry*& top) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX2
  if constexpr (W == 4) {
    push_four<AnyHit>(
        vi<4>(_mm_setr_epi32(int(child[0]), int(child[Stride]), int(child[2 * Stride]), int(child[3 * Stride]))), entry,
        hit, top);
    top += __builtin_popcount(hit);
    return;
  }
#endif
  if constexpr (Stride == 1) {
    push<W, AnyHit>(child, entry, hit, top);
  } else {
    alignas(16) bvh::NodeReference side_by_side[W];
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
    static_assert(W == 4);  // as one vector: a load that is wider than the stores before it waits for them
    _mm_store_si128(reinterpret_cast<__m128i*>(side_by_side),
                    _mm_setr_epi32(int(child[0]), int(child[Stride]), int(child[2 * Stride]), int(child[3 * Stride])));
#else
    for (int i = 0; i < W; ++i) side_by_side[i] = child[i * Stride];
#endif
    push<W, AnyHit>(side_by_side, entry, hit, top);
  }
}

/// `Nodes`: a ray and how it meets nodes, as bvh_single.h says.
template <class Nodes, class Leaves, bool AnyHit>
class BvhNodeWalk {
 public:
  static constexpr bool kAnyHit = AnyHit;
  using Target = bvh::NodeReference;
  using Entry = StackEntry;
  struct State {
    Nodes nodes;
    typename Leaves::RayData data;
    Entry* top;
    float tnear;
    NearestHit best;
  };

  BvhNodeWalk(const Accel& accel, const KernelRow& row) : BvhNodeWalk(static_cast<const bvh::BvhBase&>(accel), row) {}

  /// Beside what waits: the end, and what push() writes beyond its top.
  std::size_t stack_entries() const { return stack_entries_ + 6; }

  ARBORETUM_INLINE void start(void* state, const Ray& ray, Entry* stack) const {
    stack[0] = kDone;
    new (state) State{Nodes(ray, max_coordinate_), leaves_.prepare(ray), stack + 1, ray.tnear, NearestHit{ray.tfar}};
  }
  ARBORETUM_INLINE Target first(const State&) const { return root_; }
  static ARBORETUM_INLINE unsigned kind(Target target) { return kind_of(target); }

  ARBORETUM_INLINE void prefetch(Target target) const {
    prefetch_lines<lines_of(std::max(Nodes::kBytes, Leaves::kBytesAhead))>(base_ + bvh::offset_of(target));
  }

  ARBORETUM_INLINE Target node(State& s, Target target) const {
    const std::byte* const node = base_ + bvh::offset_of(target);
    vf<Nodes::W> entry;
    const unsigned hit = s.nodes.test(node, entry);
    push_children_of<Nodes::kStride, AnyHit>(Nodes::children(node), entry, hit, s.top);
    return pop(s);
  }

  ARBORETUM_INLINE Target leaf(State& s, Target target, Entry* stack) const {
    const std::byte* const blocks = base_ + bvh::offset_of(target);
    const unsigned count = bvh::block_count(target);
    if constexpr (AnyHit) {
      if (leaves_.any_hit(s.data, blocks, count, s.tnear, s.best.t)) s.best.primitive = 0, s.top = stack + 1;
    } else if (leaves_.closest_hit(s.data, blocks, count, s.tnear, s.best)) {
      s.nodes.shorten(s.best.t);
      Entry* out = stack + 1;
      for (const Entry* e = out; e != s.top; ++e) {
        *out = *e;
        out += __builtin_bit_cast(float, std::uint32_t(*e >> 32)) <= s.best.t;
      }
      s.top = out;
    }
    return pop(s);
  }

  ARBORETUM_INLINE void finish(State& s) const {
    if constexpr (!AnyHit) leaves_.finish(s.data, s.best);
  }

 private:
  BvhNodeWalk(const bvh::BvhBase& tree, const KernelRow& row)
      : base_(tree.base()), root_(tree.root()), max_coordinate_(tree.max_coordinate()), leaves_(row, tree.vertices()),
        stack_entries_(tree.stack_entries()) {}

  static ARBORETUM_INLINE Target pop(State& s) { return Target(*--s.top); }

  const std::byte* base_;
  bvh::NodeReference root_;
  float max_coordinate_;
  Leaves leaves_;
  std::size_t stack_entries_;
};

/// As traversal/queued_functions.h takes it, for nodes that `Nodes<Padded>` tests.
template <template <bool> class Nodes>
struct BvhNodeQueue {
  template <class Leaves, bool Padded, bool AnyHit>
  using Of = QueuedRays<BvhNodeWalk<Nodes<Padded>, Leaves, AnyHit>>;
};

/// How `auto` traces rays that share little: as rays in flight where N boxes are no more than a register
/// (docs/performance.md), else alone.
template <template <class, bool, bool> class Queue, class Single, int N>
using IncoherentInFlight = std::conditional_t<(kRegisterWidth >= N), QueuedFunctions<Queue, Single, 32, 64>, Single>;

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
