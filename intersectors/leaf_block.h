// One ray against leaf blocks: the intersector's lanes, the ray's interval, and the rule that among equal t the
// lowest primitive id wins.
//
// An intersector is a struct with
//   kName; reads(TriangleForm): whether it can read blocks of that form (indices are given to it as vertices);
//   kEveryLeaf: compiled for every block that it can read, else for the usual ones;
//   RayData(ray): what it keeps for one ray, PreparedRay::kBytes at most;
//   intersect(const RayData&, const Block&, TriangleHits<W>&): the lanes whose closed triangle the ray's line meets.
// It may have, and is asked for by name (a misspelt member is none, and what it is for stays away):
//   finish(RayData&, NearestHit&): the search is over, and this is its hit. Without it RayData never changes;
//   Unfinished<H>: hits that wait to be finished together (intersectors/round_later.h), with add(), settle() and
//     finish_all(); single rays, packets and streams of the kernels that have it compiled in;
//   accept(RayData&, const Block&, lane): that lane has become the nearest hit;
//   closest_hit_block(RayData&, const Block&, tnear, NearestHit&), any_hit_block(RayData&, const Block&, tnear, tfar):
//     instead of those below;
//   ForManyRays<Block>(const Block&): a block with what is the same for all rays, which intersect() takes in the
//     block's place, with the same answers; streams, rays of a packet that go one by one;
//   ForTwoRays<Block> and intersect_two() or test_two(): two rays at a time (intersectors/two_rays.h); streams on
//     AVX-512;
//   kDepthBetweenCorners: boxes may be tight along the ray (traversal/box_test.h); streams.
// For packets, whose rays stand in lanes (traversal/packet_leaves.h):
//   PacketData: what is kept for a packet: kGroups, rays of one group sharing a form of the test; clear();
//     prepare<W>(PacketRays&, k) of the W rays from k on; group(g): its rays as bits; alone(ray, i): RayData of ray i;
//   intersect_rays<W>(PacketRays&, PacketData&, g, k, in, Block&, i, TriangleHits<W>&, again): those of the W rays from
//     k on that `in` names, a bit each, against triangle i: the ones inside, `again` those that it leaves to
//     intersect();
//   FilteredRays<W>, filter_rays<AnyHit, W>(...), PacketHits<Block>: in intersect_rays()'s place where a hit is an
//     interval and the search has a state, which rays in lanes keep in lanes (exact_packet.h): start(), take(), at() and
//     corners(), bring() and take_back(). It needs Unfinished, and blocks that stay while a packet is traced;
//   FromOrigin<M>(const Block&, Vec3f origin): a block as seen from a common origin, taken in the block's place by
//     intersect() and intersect_rays(), with the same answers.
#pragma once

#include "intersectors/triangle_hits.h"
#include "simd/swizzle.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// is_valid() of core/ray.h in a few instructions and without a branch: it stands before every ray.
ARBORETUM_INLINE bool is_valid_in_lanes(const Ray& ray) {
  const vf<4> origin_tnear = vf<4>::load(&ray.origin), direction_tfar = vf<4>::load(&ray.direction);
  const vf<4> infinity(std::numeric_limits<float>::infinity());
  const unsigned finite = (abs(origin_tnear) < infinity).bits() & (abs(direction_tfar) < infinity).bits() & 7u;
  const unsigned nonzero = (direction_tfar != vf<4>(0.0f)).bits() & 7u;
  return (finite == 7u) & (nonzero != 0) & (ray.tnear <= ray.tfar);
}

/// What a batch reports for a ray.
ARBORETUM_INLINE Hit to_hit(const NearestHit& best) {
  return best.primitive != NearestHit::kNone ? Hit{best.t, best.u, best.v, std::uint32_t(best.primitive)} : Hit{};
}

/// The same of a hit that has stood in memory for a while, without a branch: where the rays of a picture begin to miss
/// everything cannot be foretold.
ARBORETUM_INLINE Hit stored_to_hit(const NearestHit& best) {
  static_assert(sizeof(NearestHit) == 16 && sizeof(Hit) == 16);
  const Hit nothing{};
  const auto stored = vf<4>::load(&best);
  const vm<4> missed = permute_in_fours<3, 3, 3, 3>(stored).as_int() == vi<4>(NearestHit::kNone);
  Hit hit;
  select(missed, vf<4>::load(&nothing), stored).store(&hit);
  return hit;
}

/// A block as intersectors read it: itself, or the vertices that its indices name.
template <class Block>
ARBORETUM_INLINE const Block& readable(const Block& block, const Vec3f*) {
  return block;
}
template <int M>
ARBORETUM_INLINE VertexBlock<M> readable(const IndexBlock<M>& block, const Vec3f* vertices) {
  VertexBlock<M> out;
  const auto gather = [&](const std::uint32_t* index, float(&to)[3][M]) {
    if constexpr (M == 1 || ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR) {
      for (int i = 0; i < M; ++i) {
        const Vec3f p = vertices[index[i]];
        to[0][i] = p.x, to[1][i] = p.y, to[2][i] = p.z;
      }
    } else {
      for (int i = 0; i < M; i += 4) {
        __m128 row[4];
        for (int j = 0; j < 4; ++j) {  // x y z 0, nothing read behind the vertex
          const float* p = &vertices[index[i + j]].x;
          row[j] =
              _mm_movelh_ps(_mm_castsi128_ps(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(p))), _mm_load_ss(p + 2));
        }
        _MM_TRANSPOSE4_PS(row[0], row[1], row[2], row[3]);
        for (int axis = 0; axis < 3; ++axis) _mm_storeu_ps(&to[axis][i], row[axis]);
      }
    }
  };
  gather(block.vertex[0], out.v0), gather(block.vertex[1], out.v1), gather(block.vertex[2], out.v2);
  std::memcpy(out.id, block.id, sizeof out.id);
  return out;
}

template <class Intersector>
inline constexpr bool kFinishes = requires {
  &Intersector::finish;
};

template <class Intersector, bool Changes = kFinishes<Intersector>>
struct RayDataFor {
  using Type = const typename Intersector::RayData;
};
template <class Intersector>
struct RayDataFor<Intersector, true> {
  using Type = typename Intersector::RayData;
};
/// Constant where it can be: what is written elsewhere then cannot change it, and it stays in registers.
template <class Intersector>
using RayDataOf = typename RayDataFor<Intersector>::Type;

template <class Intersector, class Block>
ARBORETUM_INLINE bool closest_hit_block(RayDataOf<Intersector>& ray, const Block& block, float tnear,
                                        NearestHit& best) {
  if constexpr (requires { Intersector::closest_hit_block(ray, block, tnear, best); }) {
    return Intersector::closest_hit_block(ray, block, tnear, best);
  } else {
    constexpr int W = Block::kWidth;
    TriangleHits<W> hits;
    vm<W> m = Intersector::intersect(ray, block, hits);
    if (none(m)) return false;
    const vi<W> id = vi<W>::load(block.id);
    m = m & (hits.t >= vf<W>(tnear)) &
        ((hits.t < vf<W>(best.t)) | ((hits.t == vf<W>(best.t)) & (id < vi<W>(best.primitive))));
    unsigned bits = m.bits();
    if (!bits) return false;
    if (bits & (bits - 1)) {
      const vf<W> t = select(m, hits.t, vf<W>(std::numeric_limits<float>::infinity()));
      unsigned nearest = (m & (t == vf<W>(reduce_min(t)))).bits();
      bits = nearest & (0u - nearest);
      for (nearest &= nearest - 1; nearest; nearest &= nearest - 1) {  // equal t: the lowest id
        if (block.id[__builtin_ctz(nearest)] < block.id[__builtin_ctz(bits)]) bits = nearest & (0u - nearest);
      }
    }
    const int lane = __builtin_ctz(bits);
    alignas(64) float t[W], u[W], v[W], den[W];
    hits.t.store(t), hits.u_numerator.store(u), hits.v_numerator.store(v), hits.denominator.store(den);
    best.t = t[lane];
    best.u = u[lane] / den[lane];
    best.v = v[lane] / den[lane];
    best.primitive = static_cast<std::int32_t>(block.id[lane]);
    if constexpr (requires { Intersector::accept(ray, block, lane); }) Intersector::accept(ray, block, lane);
    return true;
  }
}

template <class Intersector, class Block>
ARBORETUM_INLINE bool any_hit_block(RayDataOf<Intersector>& ray, const Block& block, float tnear, float tfar) {
  if constexpr (requires { Intersector::any_hit_block(ray, block, tnear, tfar); }) {
    return Intersector::any_hit_block(ray, block, tnear, tfar);
  } else {
    constexpr int W = Block::kWidth;
    TriangleHits<W> hits;
    const vm<W> m = Intersector::intersect(ray, block, hits);
    if (none(m)) return false;
    return any(m & (hits.t >= vf<W>(tnear)) & (hits.t <= vf<W>(tfar)));
  }
}

/// The intersector has a form of blocks for many rays.
template <class Intersector, class Block>
inline constexpr bool kSharesBlocks = requires {
  typename Intersector::template ForManyRays<Block>;
};

/// Tests the blocks of a leaf with `rays`, a bit each, a block after the other. `ray(i)` and `data(i)`: the i-th ray
/// and what the intersector keeps for it. Of any hit `hit(i)` is called once, for one that has met something; of the
/// closest, when `best(i)`, its nearest hit so far, is a new one.
template <bool AnyHit, class Intersector, class Block, class RayAt, class DataOf, class BestOf, class OnHit>
ARBORETUM_INLINE void test_block_by_block(const Block* block, unsigned count, std::uint64_t rays, const RayAt& ray,
                                          const DataOf& data, const BestOf& best, const OnHit& hit) {
  for (const Block* const end = block + count; block != end && rays != 0; ++block) {
    const typename Intersector::template ForManyRays<Block> seen(*block);
    for (std::uint64_t rest = rays; rest; rest &= rest - 1) {
      const int i = __builtin_ctzll(rest);
      const Ray& r = ray(i);
      auto&& of_ray = data(i);
      if constexpr (AnyHit) {
        if (any_hit_block<Intersector>(of_ray, seen, r.tnear, r.tfar)) hit(i), rays &= ~(std::uint64_t{1} << i);
      } else {
        if (closest_hit_block<Intersector>(of_ray, seen, r.tnear, best(i))) hit(i);
      }
    }
  }
}

/// The functions of LeafTests.
template <class Intersector, class Block>
struct BlockTests {
  using RayData = RayDataOf<Intersector>;

  static ARBORETUM_INLINE bool closest_hit(RayData& ray, const std::byte* blocks, unsigned count, const Vec3f* vertices,
                                           float tnear, NearestHit& best) {
    const auto* block = reinterpret_cast<const Block*>(blocks);
    const Block* const end = block + count;
    bool changed = false;
    do changed |= closest_hit_block<Intersector>(ray, readable(*block, vertices), tnear, best);
    while (++block != end);
    return changed;
  }
  static ARBORETUM_INLINE bool any_hit(RayData& ray, const std::byte* blocks, unsigned count, const Vec3f* vertices,
                                       float tnear, float tfar) {
    const auto* block = reinterpret_cast<const Block*>(blocks);
    const Block* const end = block + count;
    do {
      if (any_hit_block<Intersector>(ray, readable(*block, vertices), tnear, tfar)) return true;
    } while (++block != end);
    return false;
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
