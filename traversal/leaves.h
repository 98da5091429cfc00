// How a kernel tests its leaves: by the functions of the table of leaf tests, or with one block's and intersector's
// compiled in.
//
// A call costs a kernel what it keeps in registers, since none survives one: 1 to 2 % of a ray in bvh8 on AVX2, 6 to 8
// % in bvh16 on AVX-512, whose 32 registers otherwise hold a ray throughout (docs/performance.md). Compiling everything
// in would cost minutes of build time.
#pragma once

#include "intersectors/leaf_block.h"
#include "intersectors/two_rays.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Any leaf and intersector.
struct CalledLeaves {
  const LeafTests* tests;
  const Vec3f* vertices;
  using RayData = PreparedRay;

  CalledLeaves(const KernelRow& row, const Vec3f* mesh_vertices) : tests(row.tests), vertices(mesh_vertices) {}
  ARBORETUM_INLINE RayData prepare(const Ray& ray) const {
    RayData data;
    tests->prepare(ray, data);
    return data;
  }
  ARBORETUM_INLINE bool closest_hit(RayData& data, const std::byte* blocks, unsigned count, float tnear,
                                    NearestHit& best) const {
    return tests->closest_hit(data, blocks, count, vertices, tnear, best);
  }
  ARBORETUM_INLINE bool any_hit(RayData& data, const std::byte* blocks, unsigned count, float tnear, float tfar) const {
    return tests->any_hit(data, blocks, count, vertices, tnear, tfar);
  }
  ARBORETUM_INLINE void finish(RayData& data, NearestHit& best) const {
    if (tests->finish && best.primitive != NearestHit::kNone) tests->finish(data, best);
  }
  ARBORETUM_INLINE std::size_t block_bytes() const { return tests->form->bytes; }
  static constexpr bool kRaysInLanes = false, kBlockByBlock = false;
  static constexpr std::size_t kBytesAhead = sizeof(EdgeBlock<8>);  ///< what of a leaf is worth asking for in advance
};

/// One leaf and intersector.
template <class B, class I>
struct CompiledLeaves {
  using Block = B;
  using Intersector = I;
  using Tests = BlockTests<Intersector, Block>;
  const Vec3f* vertices;
  using RayData = RayDataOf<Intersector>;

  CompiledLeaves(const KernelRow&, const Vec3f* mesh_vertices) : vertices(mesh_vertices) {}
  ARBORETUM_INLINE RayData prepare(const Ray& ray) const { return RayData(ray); }
  ARBORETUM_INLINE bool closest_hit(RayData& data, const std::byte* blocks, unsigned count, float tnear,
                                    NearestHit& best) const {
    return Tests::closest_hit(data, blocks, count, vertices, tnear, best);
  }
  ARBORETUM_INLINE bool any_hit(RayData& data, const std::byte* blocks, unsigned count, float tnear, float tfar) const {
    return Tests::any_hit(data, blocks, count, vertices, tnear, tfar);
  }
  ARBORETUM_INLINE void finish(RayData& data, NearestHit& best) const {
    if constexpr (kFinishes<Intersector>) {
      if (best.primitive != NearestHit::kNone) Intersector::finish(data, best);
    }
  }
  static constexpr std::size_t block_bytes() { return sizeof(Block); }
  /// The intersector can test many rays against one triangle as well (packets).
  static constexpr bool kRaysInLanes = requires { typename Intersector::PacketData; };
  /// Many rays are better tested with one block after the other (test_block_by_block()).
  static constexpr bool kTwoRays = kTwoAtATime<Intersector, Block>;
  static constexpr bool kBlockByBlock = kSharesBlocks<Intersector, Block>;
  static constexpr std::size_t kBytesAhead = sizeof(Block);
};

/// What leaves keep for a ray of that time, which only those whose triangles move look at.
template <class Leaves>
ARBORETUM_INLINE typename Leaves::RayData prepare_at(const Leaves& leaves, const Ray& ray,
                                                     [[maybe_unused]] float time) {
  if constexpr (requires { leaves.prepare(ray, time); }) {
    return leaves.prepare(ray, time);
  } else {
    return leaves.prepare(ray);
  }
}

/// A ray visits a leaf for any hit; blocks are counted up to and including the one that it hits.
template <class Leaves, class RayData, class Counting>
ARBORETUM_INLINE bool any_hit_in_leaf(const Leaves& leaves, RayData& data, [[maybe_unused]] const LeafForm& form,
                                      [[maybe_unused]] const Counting& counting, const std::byte* blocks,
                                      unsigned count, float tnear, float tfar) {
  if constexpr (Counting::kCounting) {
    counting.leaf(form, blocks, 0);
    for (const std::byte* const end = blocks + count * form.bytes; blocks != end; blocks += form.bytes) {
      counting.blocks(form, blocks, 1);
      if (leaves.any_hit(data, blocks, 1, tnear, tfar)) return true;
    }
    return false;
  } else {
    return leaves.any_hit(data, blocks, count, tnear, tfar);
  }
}

/// Leaves that know how a leaf is tested with many rays: by test_many(), which takes what test_leaf() does after the
/// leaves.
template <class Leaves>
inline constexpr bool kTestsMany = requires {
  Leaves::kMany;
};

/// Leaves whose blocks are tested with two rays at a time (intersectors/two_rays.h).
template <class Leaves>
inline constexpr bool kTestsTwo = requires {
  requires Leaves::kTwoRays;
};

/// Tests a leaf with `rays`, a bit each: one ray after the other, or one block after the other where that is better.
/// `ray(i)` and `data(i)`: the i-th ray and what the intersector keeps for it. Of any hit `hit(i)` is called once, for
/// one that has met something; of the closest, when `best(i)`, its nearest hit so far, is a new one.
/// `Two`: two rays at a time, where the leaves can (streams; packets lose by it).
template <bool AnyHit, bool Two = false, class Leaves, class Counting, class RayAt, class DataOf, class BestOf,
          class OnHit>
ARBORETUM_INLINE void test_leaf(const Leaves& leaves, [[maybe_unused]] const LeafForm& form,
                                [[maybe_unused]] const Counting& counting, const std::byte* blocks, unsigned count,
                                std::uint64_t rays, const RayAt& ray, const DataOf& data, const BestOf& best,
                                const OnHit& hit) {
  if constexpr (kTestsMany<Leaves>) {
    leaves.template test_many<AnyHit>(form, counting, blocks, count, rays, ray, data, best, hit);
#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
  } else if constexpr (Two && kTestsTwo<Leaves>) {
    test_two_by_two<AnyHit, typename Leaves::Intersector>(reinterpret_cast<const typename Leaves::Block*>(blocks),
                                                          count, rays, ray, data, best, hit);
#endif
  } else if constexpr (Leaves::kBlockByBlock) {
    test_block_by_block<AnyHit, typename Leaves::Intersector>(reinterpret_cast<const typename Leaves::Block*>(blocks),
                                                              count, rays, ray, data, best, hit);
  } else {
    for (; rays; rays &= rays - 1) {
      const int i = __builtin_ctzll(rays);
      if constexpr (Counting::kCounting && !AnyHit) counting.leaf(form, blocks, count);
      const Ray& r = ray(i);
      auto&& of_ray = data(i);
      if (AnyHit ? any_hit_in_leaf(leaves, of_ray, form, counting, blocks, count, r.tnear, r.tfar)
                 : leaves.closest_hit(of_ray, blocks, count, r.tnear, best(i)))
        hit(i);
    }
  }
}

/// Where the intersector can finish the hits of several rays together (intersectors/round_later.h), what they wait in;
/// else nothing.
template <class Leaves>
inline constexpr bool kFinishesLater = requires {
  typename Leaves::Intersector::template Unfinished<Hit>;
};
struct NothingUnfinished {};
template <class Leaves, class H, bool Later = kFinishesLater<Leaves>>
struct UnfinishedOf {
  using Type = NothingUnfinished;
};
template <class Leaves, class H>
struct UnfinishedOf<Leaves, H, true> {
  using Type = typename Leaves::Intersector::template Unfinished<H>;
};

/// The searches of `rays`, a bit each, are over: finishes their hits, together where that can be. `ray(i)`, `data(i)`,
/// `best(i)` as of test_leaf().
template <class Leaves, class RayAt, class DataOf, class BestOf>
ARBORETUM_INLINE void finish_hits(const Leaves& leaves, std::uint64_t rays, [[maybe_unused]] const RayAt& ray,
                                  const DataOf& data, const BestOf& best) {
  [[maybe_unused]] typename UnfinishedOf<Leaves, NearestHit>::Type unfinished;
  for (; rays; rays &= rays - 1) {
    const int i = __builtin_ctzll(rays);
    if (best(i).primitive == NearestHit::kNone) continue;
    auto&& of_ray = data(i);
    if constexpr (kFinishesLater<Leaves>) {
      unfinished.add(ray(i), of_ray.best);
      unfinished.settle(best(i));
    } else {
      leaves.finish(of_ray, best(i));
    }
  }
  if constexpr (kFinishesLater<Leaves>) unfinished.finish_all();
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
