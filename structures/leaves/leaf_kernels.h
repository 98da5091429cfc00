// What the kernels of structures with shared leaves (leaf_lists.h) have in common: the test of a leaf, the
// loop over a batch, the rows.
#pragma once

#include "intersectors/leaf_block.h"
#include "intersectors/moller_trumbore.h"
#include "intersectors/pluecker.h"
#include "intersectors/watertight.h"
#include "structures/leaves/leaf_lists.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Tests leaves against one ray. Closest hit: updates `best` and returns false; any hit: true where there is
/// one.
template <class Block, class Intersector, bool AnyHit>
class LeafTests {
 public:
  ARBORETUM_INLINE LeafTests(const LeafStore& leaves, const Ray& ray, NearestHit& best)
      : leaves_(leaves), data_(ray), ray_(ray), best_(best) {}

  template <class Counting>
  ARBORETUM_INLINE bool operator()(LeafCode code, Counting& counting) {
    if constexpr (Counting::kCounting) count(code, counting.counters);
    return test(code);
  }

 private:
  /// Not inlined: a walk calls it from several places, fast and padded, counting or not, and each copy would
  /// cost compile time.
  __attribute__((noinline)) bool test(LeafCode code) {
    LeafCode count = code & kLeafCountMask;
    std::size_t first = code >> kLeafShift;
    if (__builtin_expect(count == kLongLeaf, 0))
      count = leaves_.long_leaves()[first].blocks, first = leaves_.long_leaves()[first].first;
    const auto* block = reinterpret_cast<const Block*>(leaves_.blocks()) + first;
    for (const Block* const end = block + count; block != end; ++block) {
      if constexpr (AnyHit) {
        if (any_hit_block<Intersector>(data_, readable(*block, leaves_.vertices()), ray_.tnear, ray_.tfar))
          return true;
      } else {
        closest_hit_block<Intersector>(data_, readable(*block, leaves_.vertices()), ray_.tnear, best_);
      }
    }
    return false;
  }

  /// What the whole leaf costs; an any hit that ends earlier is counted as if it went on.
  void count(LeafCode code, Counters& counters) const {
    const LongLeaf range = leaves_.range(code);
    const auto* block = reinterpret_cast<const Block*>(leaves_.blocks()) + range.first;
    ++counters.leaves;
    counters.blocks += range.blocks;
    for (const Block* const end = block + range.blocks; block != end; ++block) {
      counters.lanes += Block::kWidth;
      counters.triangles += unsigned(triangles_in(*block)),
          counters.lanes_active += unsigned(triangles_in(*block));
    }
  }

  const LeafStore& leaves_;
  const typename Intersector::RayData data_;
  const Ray& ray_;
  NearestHit& best_;
};

/// What a kernel that needs nothing beside its frame keeps for a batch.
struct NoScratch {
  template <class Structure>
  explicit NoScratch(const Structure&) {}
};

/// The four functions of a row, from Kernel<Block, Intersector, Padded, Counting>::trace<AnyHit>(structure,
/// ray, best, counting, scratch); the scratch, of type Kernel::Scratch, is made from the structure once a
/// batch.
template <class Structure, template <class, class, bool, class> class Kernel, class Block, class Intersector,
          bool Padded>
struct SingleRayMaker {
  template <class Counting>
  static void closest(const Accel& accel, RayBatch rays, std::span<Hit> hits, Counters* counters) {
    const auto& structure = static_cast<const Structure&>(accel);
    Counting counting(counters);
    typename Kernel<Block, Intersector, Padded, Counting>::Scratch scratch(structure);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      NearestHit best{rays[i].tfar};
      if (is_valid_in_lanes(rays[i]))
        Kernel<Block, Intersector, Padded, Counting>::template trace<false>(structure, rays[i], best,
                                                                            counting, scratch);
      hits[i] = to_hit(best);
    }
    if constexpr (Counting::kCounting) counting.counters.rays += rays.size();
  }
  template <class Counting>
  static void any(const Accel& accel, RayBatch rays, std::span<std::uint8_t> occluded, Counters* counters) {
    const auto& structure = static_cast<const Structure&>(accel);
    Counting counting(counters);
    typename Kernel<Block, Intersector, Padded, Counting>::Scratch scratch(structure);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      NearestHit best{rays[i].tfar};
      occluded[i] =
          is_valid_in_lanes(rays[i]) && Kernel<Block, Intersector, Padded, Counting>::template trace<true>(
                                            structure, rays[i], best, counting, scratch);
    }
    if constexpr (Counting::kCounting) counting.counters.rays += rays.size();
  }
  static void closest_hit(const Accel& a, RayBatch r, std::span<Hit> h, Counters* c) {
    closest<NoCounters>(a, r, h, c);
  }
  static void any_hit(const Accel& a, RayBatch r, std::span<std::uint8_t> h, Counters* c) {
    any<NoCounters>(a, r, h, c);
  }
  static void count_closest_hit(const Accel& a, RayBatch r, std::span<Hit> h, Counters* c) {
    closest<WithCounters>(a, r, h, c);
  }
  static void count_any_hit(const Accel& a, RayBatch r, std::span<std::uint8_t> h, Counters* c) {
    any<WithCounters>(a, r, h, c);
  }
};

/// The full leaf axis for the fastest and the crack-free intersector; else the default leaves (compile time).
template <template <class, class, bool> class Maker>
void add_single_rows(KernelRows& rows, std::string_view structure) {
  add_rows<Maker>(rows, structure, "single", kIsa, BlocksOfWidth<EdgeBlock, kRegisterWidth>{},
                  TypeList<MollerTrumbore>{});
  add_rows<Maker>(rows, structure, "single", kIsa, BlocksOfWidth<VertexBlock, kRegisterWidth>{},
                  TypeList<Watertight>{});
  add_rows<Maker>(rows, structure, "single", kIsa, TypeList<VertexBlock<4>>{}, TypeList<Pluecker>{});
  add_rows<Maker>(rows, structure, "single", kIsa, TypeList<IndexBlock<4>>{}, TypeList<Watertight>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
