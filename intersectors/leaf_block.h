// One ray against one leaf block: the intersector's lanes, the ray's interval, and the rule that among equal t the
// lowest primitive id wins.
#pragma once

#include "intersectors/triangle_hits.h"

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

/// The nearest hit so far. `primitive` is INT_MAX while there is none, so that a hit at exactly tfar still counts.
struct NearestHit {
  static constexpr std::int32_t kNone = std::numeric_limits<std::int32_t>::max();
  float t;
  float u = 0.0f, v = 0.0f;
  std::int32_t primitive = kNone;
};

/// What a batch reports for a ray.
ARBORETUM_INLINE Hit to_hit(const NearestHit& best) {
  return best.primitive != NearestHit::kNone ? Hit{best.t, best.u, best.v, std::uint32_t(best.primitive)} : Hit{};
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
          row[j] = _mm_movelh_ps(_mm_castpd_ps(_mm_load_sd(reinterpret_cast<const double*>(p))), _mm_load_ss(p + 2));
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

template <class Intersector, class Block>
ARBORETUM_INLINE bool closest_hit_block(const typename Intersector::RayData& ray, const Block& block, float tnear, NearestHit& best) {
  constexpr int W = Block::kWidth;
  TriangleHits<W> hits;
  vm<W> m = Intersector::intersect(ray, block, hits);
  if (none(m)) return false;
  const vi<W> id = vi<W>::load(block.id);
  m = m & (hits.t >= vf<W>(tnear)) & ((hits.t < vf<W>(best.t)) | ((hits.t == vf<W>(best.t)) & (id < vi<W>(best.primitive))));
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
  return true;
}

template <class Intersector, class Block>
ARBORETUM_INLINE bool any_hit_block(const typename Intersector::RayData& ray, const Block& block, float tnear, float tfar) {
  constexpr int W = Block::kWidth;
  TriangleHits<W> hits;
  const vm<W> m = Intersector::intersect(ray, block, hits);
  if (none(m)) return false;
  return any(m & (hits.t >= vf<W>(tnear)) & (hits.t <= vf<W>(tfar)));
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
