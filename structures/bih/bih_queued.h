// Many rays in flight through a bounding interval hierarchy (traversal/queued_rays.h), by the steps of bih_single.h.
//
// A step is two planes, less work than to put it on a queue: one node at a time, rays in flight took 1.4 to 2.7 times
// as long as one after the other (docs/performance.md). So a turn of a node goes on to the next leaf that the ray comes
// to; what is asked for ahead are that leaf's blocks, and the node that waits after it.
#pragma once

#include "structures/bih/bih_single.h"
#include "structures/leaves/leaf_lists_queued.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <class Leaves, bool AnyHit>
class BihQueuedWalk : public ListedQueuedWalk<bih::Bih, Leaves, AnyHit> {
  using Base = ListedQueuedWalk<bih::Bih, Leaves, AnyHit>;
  using Base::tree_;

 public:
  using typename Base::Target;
  using Entry = IntervalEntry;
  struct State {
    IntervalRay interval;
    Entry *top, *stack;
    float low, high, tnear;
    NearestHit best;
    typename Leaves::RayData data;
  };

  BihQueuedWalk(const Accel& accel, const KernelRow& row) : Base(accel, row) {}

  std::size_t stack_entries() const { return tree_.stack_entries(); }

  ARBORETUM_INLINE void start(void* state, const Ray& ray, float /*time*/, Entry* stack) const {
    State& s = *new (state) State{Base::template constants<IntervalRay, 2>(ray),
                                  stack,
                                  stack,
                                  ray.tnear,
                                  ray.tfar,
                                  ray.tnear,
                                  NearestHit{ray.tfar},
                                  Base::leaves_.prepare(ray)};
    clip_to_scene(tree_, s.interval, s.low, s.high);
  }
  ARBORETUM_INLINE Target first(const State& s) const {
    return s.low <= s.high ? Target{0, Target::kNode} : Base::kEnd;
  }

  ARBORETUM_INLINE void prefetch(Target target) const {
    if (target.kind == Target::kLeaf) {
      Base::prefetch_leaf(target.at);
    } else {
      _mm_prefetch(reinterpret_cast<const char*>(tree_.nodes() + target.at), _MM_HINT_T0);
    }
  }

  ARBORETUM_INLINE Target node(State& s, Target target) const {
    const bih::Node* const nodes = tree_.nodes();
    float low = s.low, high = s.high;
    Entry* top = s.top;
    std::uint32_t at = target.at;
    do {
      const bih::Node* const node = nodes + at;
      const std::uint32_t kind = node->kind();
      if (kind == bih::Node::kLeaf) {
        s.top = top;
        return {node->code(), Target::kLeaf};
      }
      at = step_bih<AnyHit>(node, kind, s.interval, low, high, top, NoCounters(nullptr));
      if (at == kNoNode) at = pop_bih<AnyHit>(top, s.stack, low, high, s.best.t);
    } while (at != kNoNode);
    return Base::kEnd;
  }

  ARBORETUM_INLINE Target leaf(State& s, Target target, Entry*) const {
    if (Base::test(s, target.at)) return Base::kEnd;
    const std::uint32_t next = pop_bih<AnyHit>(s.top, s.stack, s.low, s.high, s.best.t);
    return next != kNoNode ? Target{next, Target::kNode} : Base::kEnd;
  }
};

template <class Leaves, bool, bool AnyHit>
using BihQueued = QueuedRays<BihQueuedWalk<Leaves, AnyHit>>;

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
