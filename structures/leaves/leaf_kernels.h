// What the kernels of structures with shared leaves (leaf_lists.h) have in common: single rays of a walk through such a
// structure.
#pragma once

#include "structures/leaves/leaf_lists.h"
#include "traversal/kernel_rows.h"
#include "traversal/single_rays.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Tests leaves against one ray. Closest hit: updates `best` and returns false; any hit: true where there is one.
template <class Leaves, bool AnyHit, class Counting>
class LeafVisits {
 public:
  ARBORETUM_INLINE LeafVisits(const LeafStore& store, const Leaves& leaves, const LeafForm& form, const Ray& ray,
                              NearestHit& best, const Counting& counting)
      : store_(store), leaves_(leaves), form_(form), ray_(ray), best_(best), counting_(counting),
        data_(leaves.prepare(ray)) {}

  ARBORETUM_INLINE bool operator()(LeafCode code) {
    LeafCode count = code & kLeafCountMask;
    std::size_t first = code >> kLeafShift;
    if (__builtin_expect(count == kLongLeaf, 0))
      count = store_.long_leaves()[first].blocks, first = store_.long_leaves()[first].first;
    const std::byte* const blocks = store_.blocks() + first * leaves_.block_bytes();
    if constexpr (AnyHit)
      return any_hit_in_leaf(leaves_, data_, form_, counting_, blocks, count, ray_.tnear, ray_.tfar);
    counting_.leaf(form_, blocks, count);
    leaves_.closest_hit(data_, blocks, count, ray_.tnear, best_);
    return false;
  }
  ARBORETUM_INLINE void finish() {
    if constexpr (!AnyHit) leaves_.finish(data_, best_);
  }

 private:
  const LeafStore& store_;
  const Leaves& leaves_;
  const LeafForm& form_;
  const Ray& ray_;
  NearestHit& best_;
  const Counting& counting_;
  typename Leaves::RayData data_;
};

/// What a walk that needs nothing beside its frame keeps for a batch.
struct NoScratch {
  template <class Structure>
  explicit NoScratch(const Structure&) {}
};

/// Rows of single rays from Walk<Padded, Counting>::trace(structure, ray, best, counting, scratch, visits), which calls
/// visits(code) for the leaves that the ray may meet and stops where that is true; the scratch, of type Walk::Scratch,
/// is made from the structure once a batch. Leaves are called, not compiled in: here that costs 1 % and saves two
/// fifths of the compile time.
template <class Structure, template <bool, class> class Walk>
struct ListedLeaves {
  template <class Leaves, bool Padded, class Counting>
  class Kernel {
   public:
    Kernel(const Accel& accel, const KernelRow& row, Counting counting)
        : structure_(static_cast<const Structure&>(accel)), leaves_(row, structure_.leaves().vertices()),
          form_(*row.tests->form), counting_(counting), scratch_(structure_) {}

    template <bool AnyHit>
    ARBORETUM_INLINE bool trace(const Ray& ray, float /*time*/, NearestHit& best) {
      LeafVisits<Leaves, AnyHit, Counting> visits(structure_.leaves(), leaves_, form_, ray, best, counting_);
      const bool hit =
          Walk<Padded, Counting>::template trace<AnyHit>(structure_, ray, best, counting_, scratch_, visits);
      visits.finish();
      return hit;
    }

   private:
    const Structure& structure_;
    Leaves leaves_;
    const LeafForm& form_;
    Counting counting_;
    typename Walk<Padded, Counting>::Scratch scratch_;
  };

  using Functions = SingleRayFunctions<Kernel>;
  static void add(KernelRows& rows) { add_rows<Structure, Functions>(rows, "single", TypeList<>{}); }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
