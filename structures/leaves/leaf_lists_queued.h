// What rays in flight (traversal/queued_rays.h) through structures with shared leaves (leaf_lists.h) have in common:
// the tree, leaves by their code, and targets that are a node's number, a leaf's code or the end.
#pragma once

#include "structures/leaves/leaf_lists.h"
#include "traversal/box_test.h"
#include "traversal/prefetch.h"
#include "traversal/queued_rays.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

struct ListedTarget {
  enum Kind : std::uint32_t { kNode = 0, kLeaf = 1, kNothing = 2 };
  std::uint32_t at;
  Kind kind;
};

/// `Tree` has leaves() and max_coordinate(); `fast` and `padded` boxes are one walk with other constants.
template <class Tree, class Leaves, bool AnyHit>
class ListedQueuedWalk {
 public:
  static constexpr bool kAnyHit = AnyHit;
  using Target = ListedTarget;
  static constexpr Target kEnd = {0, Target::kNothing};

  static ARBORETUM_INLINE unsigned kind(Target target) { return target.kind; }

  template <class State>
  ARBORETUM_INLINE void finish(State& s) const {
    if constexpr (!AnyHit) leaves_.finish(s.data, s.best);
  }

 protected:
  ListedQueuedWalk(const Accel& accel, const KernelRow& row)
      : tree_(static_cast<const Tree&>(accel)), store_(tree_.leaves()), leaves_(row, store_.vertices()),
        padded_(row.box == "padded") {}

  /// A ray's constants, made of those for N boxes.
  template <class Constants, int N>
  ARBORETUM_INLINE Constants constants(const Ray& ray) const {
    const float m = tree_.max_coordinate();
    return padded_ ? Constants(BoxRay<N, true>(ray, m)) : Constants(BoxRay<N, false>(ray, m));
  }

  ARBORETUM_INLINE void prefetch_leaf(LeafCode code) const {
    prefetch_lines<lines_of(Leaves::kBytesAhead)>(blocks_of(store_.range(code)));
  }

  /// Returns whether the search ends: any hit has its answer. `State` has tnear beside what traversal/queued_rays.h
  /// asks for.
  template <class State>
  ARBORETUM_INLINE bool test(State& s, LeafCode code) const {
    const LongLeaf range = store_.range(code);
    if constexpr (AnyHit) {
      if (!leaves_.any_hit(s.data, blocks_of(range), range.blocks, s.tnear, s.best.t)) return false;
      s.best.primitive = 0;
      return true;
    }
    leaves_.closest_hit(s.data, blocks_of(range), range.blocks, s.tnear, s.best);
    return false;
  }

  ARBORETUM_INLINE const std::byte* blocks_of(LongLeaf range) const {
    return store_.blocks() + range.first * leaves_.block_bytes();
  }

  const Tree& tree_;
  const LeafStore& store_;
  const Leaves leaves_;
  const bool padded_;
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
