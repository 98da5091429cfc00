// Many rays in flight through a kd-tree (traversal/queued_rays.h).
//
// A ray's next cell is the top of its stack. A step takes it, writes the far side and on top of it the near side (any
// hit: the other way round), and moves the top by those that the ray meets, so that it has no branch whatever the ray
// does: near, far, both or neither. Cells beyond a new hit leave the stack when it is found; what is pushed later
// begins before it ends, and no cell ends beyond the nearest hit, so the steps compare nothing with it and yet visit
// just the cells of kdtree_single.h.
#pragma once

#include "structures/kdtree/kdtree_single.h"
#include "traversal/prefetch.h"
#include "traversal/queued_rays.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <class Leaves, bool AnyHit>
class KdQueuedWalk {
 public:
  using Target = std::uint64_t;  ///< a node's bits; those of an empty cell are the end of a ray's stack
  using Entry = KdStackEntry;
  struct State {
    KdRay planes;
    Entry* top;
    float tnear;
    NearestHit best;
    typename Leaves::RayData data;
  };

  KdQueuedWalk(const Accel& accel, const KernelRow& row)
      : KdQueuedWalk(static_cast<const kdtree::KdTree&>(accel), row) {}

  std::size_t stack_entries() const { return stack_entries_; }

  ARBORETUM_INLINE void start(void* state, const Ray& ray, float /*time*/, Entry* stack) const {
    State& s = *new (state) State{KdRay(ray, max_coordinate_, pad_), stack + 1, ray.tnear, NearestHit{ray.tfar},
                                  leaves_.prepare(ray)};
    stack[0] = {kdtree::kEmptyCell, 0.0f, 0.0f};
    float begin = ray.tnear, end = ray.tfar;
    s.planes.clip(bounds_, begin, end);
    stack[1] = {root_, begin, end};
    s.top += !(begin > end);
  }
  ARBORETUM_INLINE Target first(const State& s) const { return s.top[-1].node; }

  static ARBORETUM_INLINE unsigned kind(Target node) {
    const bool leaf = (std::uint32_t(node >> 32) & 3u) == 3u;
    return unsigned(leaf) + unsigned(node == kdtree::kEmptyCell);
  }

  ARBORETUM_INLINE void prefetch(Target node) const { prefetch_lines<lines_of(Leaves::kBytesAhead)>(place_of(node)); }

  ARBORETUM_INLINE Target node(State& s, Target node) const {
    Entry* top = s.top - 1;
    const float begin = top->begin, limit = top->end, end = limit < s.best.t ? limit : s.best.t;
    const KdSides sides = sides_of(node, base_, s.planes, begin, end);
    const Entry near{sides.near, begin, sides.near_end}, far{sides.far, sides.far_begin, end};
    *top = AnyHit ? near : far;
    top += AnyHit ? sides.in_near : sides.in_far;
    *top = AnyHit ? far : near;
    top += AnyHit ? sides.in_far : sides.in_near;
    s.top = top;
    return top[-1].node;
  }

  ARBORETUM_INLINE Target leaf(State& s, Target node, Entry* stack) const {
    const std::byte* const blocks = place_of(node);
    const auto count = std::uint32_t(node);
    --s.top;
    if constexpr (AnyHit) {
      if (leaves_.any_hit(s.data, blocks, count, s.tnear, s.best.t)) s.best.primitive = 0, s.top = stack + 1;
    } else if (leaves_.closest_hit(s.data, blocks, count, s.tnear, s.best)) {
      Entry* out = stack + 1;
      for (const Entry* e = out; e != s.top; ++e) {
        *out = *e;
        out += !(e->begin > s.best.t);
      }
      s.top = out;
    }
    return s.top[-1].node;
  }

  ARBORETUM_INLINE void finish(State& s) const {
    if constexpr (!AnyHit) leaves_.finish(s.data, s.best);
  }

 private:
  KdQueuedWalk(const kdtree::KdTree& tree, const KernelRow& row)
      : base_(tree.base()), root_(__builtin_bit_cast(std::uint64_t, tree.root())), bounds_(tree.bounds()),
        max_coordinate_(tree.max_coordinate()), pad_(row.box == "padded" ? KdRay::kPad : 0.0f),
        leaves_(row, tree.vertices()), stack_entries_(tree.stack_entries() + 2) {}

  ARBORETUM_INLINE const std::byte* place_of(Target node) const { return place_in_kdtree(base_, node); }

  const std::byte* base_;
  std::uint64_t root_;
  Bounds3f bounds_;
  float max_coordinate_, pad_;
  Leaves leaves_;
  std::size_t stack_entries_;
};

/// `fast` and `padded` are one walk with other constants.
template <class Leaves, bool, bool AnyHit>
using KdQueued = QueuedRays<KdQueuedWalk<Leaves, AnyHit>>;

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
