// Two rays against a leaf's blocks of eight triangles at a time, one in each half of AVX-512's sixteen lanes: for ways
// of traversal in which several rays visit a leaf together. Each gets the bits that it would get alone.
//
// An intersector takes part that has
//   ForTwoRays<Block>(const Block&): a block as two rays read it, or a reference to the block itself; with its id; and
//   intersect_two(const RayData&, const RayData&, const ForTwoRays<Block>&, TriangleHits<16>&): the lanes whose closed
//     triangle the line meets, as intersect() of leaf_block.h; or
//   test_two<AnyHit>(...) in the place of that below;
// and that has no accept() of its own.
#pragma once

#include "intersectors/leaf_block.h"
#include "simd/swizzle.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512

template <class Intersector, class Block>
inline constexpr bool kTwoAtATime = Block::kWidth == 8 && requires {
  typename Intersector::template ForTwoRays<Block>;
}
&&!requires(RayDataOf<Intersector> & ray, const Block& block) { Intersector::accept(ray, block, 0); };

/// Of two rays those that have met something, of any hit, or have a new nearest hit: bit 0 the one in the lower half,
/// bit 1 the one in the upper.
template <bool AnyHit, class Intersector, class Seen>
ARBORETUM_INLINE unsigned test_two(RayDataOf<Intersector>& low, RayDataOf<Intersector>& high, const Seen& block,
                                   const Ray& low_ray, const Ray& high_ray, NearestHit& low_best,
                                   NearestHit& high_best) {
  if constexpr (requires {
                  Intersector::template test_two<AnyHit>(low, high, block, low_ray, high_ray, low_best, high_best);
                }) {
    return Intersector::template test_two<AnyHit>(low, high, block, low_ray, high_ray, low_best, high_best);
  } else {
    TriangleHits<16> hits;
    const vm<16> met = Intersector::intersect_two(low, high, block, hits);
    if (none(met)) return 0;
    const vf<16> tfar = AnyHit ? in_halves(low_ray.tfar, high_ray.tfar) : in_halves(low_best.t, high_best.t);
    const unsigned within = (met & (hits.t >= in_halves(low_ray.tnear, high_ray.tnear)) & (hits.t <= tfar)).bits();
    if constexpr (AnyHit) return unsigned((within & 0xffu) != 0) | unsigned(within > 0xffu) << 1;
    if (within == 0) return 0;
    alignas(64) float t[16], u[16], v[16], den[16];
    hits.t.store(t), hits.u_numerator.store(u), hits.v_numerator.store(v), hits.denominator.store(den);
    const auto take = [&](NearestHit& best, unsigned lanes, unsigned first) {
      bool nearer = false;
      for (; lanes; lanes &= lanes - 1) {
        const unsigned lane = unsigned(__builtin_ctz(lanes)), i = first + lane;
        const auto id = std::int32_t(block.id[lane]);
        if (t[i] < best.t || (t[i] == best.t && id < best.primitive))
          best = {t[i], u[i] / den[i], v[i] / den[i], id}, nearer = true;
      }
      return nearer;
    };
    const bool first = take(low_best, within & 0xffu, 0), second = take(high_best, within >> 8, 8);
    return unsigned(first) | unsigned(second) << 1;
  }
}

/// What test_block_by_block() of leaf_block.h does. A ray that is left over goes alone.
template <bool AnyHit, class Intersector, class Block, class RayAt, class DataOf, class BestOf, class OnHit>
ARBORETUM_INLINE void test_two_by_two(const Block* block, unsigned count, std::uint64_t rays, const RayAt& ray,
                                      const DataOf& data, const BestOf& best, const OnHit& hit) {
  const auto met = [&](int i) {
    if constexpr (AnyHit) rays &= ~(std::uint64_t{1} << i);
    hit(i);
  };
  for (const Block* const end = block + count; block != end && rays != 0; ++block) {
    std::uint64_t rest = rays;
    if ((rest & (rest - 1)) != 0) {
      const typename Intersector::template ForTwoRays<Block> seen(*block);
      do {
        const int i = __builtin_ctzll(rest);
        rest &= rest - 1;
        const int k = __builtin_ctzll(rest);
        rest &= rest - 1;
        auto&& low = data(i);
        auto&& high = data(k);
        const unsigned changed = test_two<AnyHit, Intersector>(low, high, seen, ray(i), ray(k), best(i), best(k));
        if (changed & 1u) met(i);
        if (changed & 2u) met(k);
      } while ((rest & (rest - 1)) != 0);
    }
    if (rest != 0) {
      const int i = __builtin_ctzll(rest);
      const Ray& r = ray(i);
      auto&& of_ray = data(i);
      if (AnyHit ? any_hit_block<Intersector>(of_ray, *block, r.tnear, r.tfar)
                 : closest_hit_block<Intersector>(of_ray, *block, r.tnear, best(i)))
        met(i);
    }
  }
}

#else

template <class Intersector, class Block>
inline constexpr bool kTwoAtATime = false;

#endif

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
