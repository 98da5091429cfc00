// Many rays in flight through an octree (traversal/queued_rays.h), by the steps of octree_single.h.
//
// A node has no place of its own, it comes with the visit: each ray keeps the cell of its next step, and a target names
// what of memory that step reads, the cell's children or a leaf's blocks. A leaf that the ray comes from is no step:
// neighbouring cells may share one.
#pragma once

#include "structures/leaves/leaf_lists_queued.h"
#include "structures/octree/octree_single.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <class Leaves, bool AnyHit>
class OctreeQueuedWalk : public ListedQueuedWalk<octree::Octree, Leaves, AnyHit> {
  using Base = ListedQueuedWalk<octree::Octree, Leaves, AnyHit>;
  using Base::tree_;

 public:
  using typename Base::Target;
  using Entry = OctreeEntry;
  struct State {
    OctreeRay box;
    Entry cell;
    Entry *top, *stack;
    float tnear;
    LeafCode last;
    NearestHit best;
    typename Leaves::RayData data;
  };

  OctreeQueuedWalk(const Accel& accel, const KernelRow& row) : Base(accel, row) {}

  std::size_t stack_entries() const { return kMostOctreeCells; }

  ARBORETUM_INLINE void start(void* state, const Ray& ray, float /*time*/, Entry* stack) const {
    new (state) State{Base::template constants<OctreeRay, 8>(ray),
                      {{{0, 0, 0, 0}, tree_.nodes()[0], 0}, 0.0f},
                      stack,
                      stack,
                      ray.tnear,
                      kEmptyLeaf,
                      NearestHit{ray.tfar},
                      Base::leaves_.prepare(ray)};
  }
  ARBORETUM_INLINE Target first(State& s) const { return next(s); }

  ARBORETUM_INLINE void prefetch(Target target) const {
    if (target.kind == Target::kLeaf) {
      Base::prefetch_leaf(target.at);
    } else {
      const auto* at = reinterpret_cast<const char*>(tree_.nodes() + target.at);
      _mm_prefetch(at, _MM_HINT_T0), _mm_prefetch(at + 8 * sizeof(octree::Node) - 1, _MM_HINT_T0);
    }
  }

  ARBORETUM_INLINE Target node(State& s, Target) const {
    if (step_octree<AnyHit>(tree_, s.box, s.cell, s.tnear, s.best.t, s.top, NoCounters(nullptr))) return next(s);
    return pop(s);
  }

  ARBORETUM_INLINE Target leaf(State& s, Target target, Entry*) const {
    return Base::test(s, target.at) ? Base::kEnd : pop(s);
  }

 private:
  /// To the ray's cell, or to what waits where that is a leaf that the ray comes from.
  static ARBORETUM_INLINE Target next(State& s) {
    do {
      const octree::Node node = s.cell.cell.node;
      if (node.mask != 0) return {node.first, Target::kNode};
      if (node.first != s.last) return {s.last = node.first, Target::kLeaf};
    } while (pop_octree<AnyHit>(s.top, s.stack, s.cell, s.best.t));
    return Base::kEnd;
  }
  static ARBORETUM_INLINE Target pop(State& s) {
    return pop_octree<AnyHit>(s.top, s.stack, s.cell, s.best.t) ? next(s) : Base::kEnd;
  }
};

template <class Leaves, bool, bool AnyHit>
using OctreeQueued = QueuedRays<OctreeQueuedWalk<Leaves, AnyHit>>;

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
