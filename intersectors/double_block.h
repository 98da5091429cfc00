// What the intersectors that compute in double share: a block's triangles, widened and worked through as many at a time
// as a register holds doubles; t, u and v divided and rounded to float once, at the end.
#pragma once

#include "intersectors/triangle_hits.h"
#include "simd/double.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// One ray's constants.
struct RayInDouble {
  double origin[3], direction[3];
  ARBORETUM_INLINE explicit RayInDouble(const Ray& ray)
      : origin{ray.origin.x, ray.origin.y, ray.origin.z}, direction{ray.direction.x, ray.direction.y, ray.direction.z} {
  }
};

/// Calls Test::test(v0, v1, v2, o, d, t, u, v) for each group of lanes, all but the last three vd3; it gives the lanes
/// that are hit as bits, and where there is any sets t, u, v of the group. Gives the lanes of the block that are hit.
template <class Test, class Block>
ARBORETUM_INLINE vm<Block::kWidth> intersect_in_double(const RayInDouble& ray, const Block& block,
                                                       TriangleHits<Block::kWidth>& hits) {
  constexpr int W = Block::kWidth, D = kDoubleLanes<W>;
  using F = vd<D>;
  const vd3<D> o{F(ray.origin[0]), F(ray.origin[1]), F(ray.origin[2])};
  const vd3<D> d{F(ray.direction[0]), F(ray.direction[1]), F(ray.direction[2])};
  float t[W] = {}, u[W] = {}, v[W] = {};
  unsigned inside = 0;
  for (int i = 0; i < W; i += D) {
    F group_t, group_u, group_v;
    const unsigned bits =
        Test::test(load3<D>(block.v0[0] + i, block.v0[1] + i, block.v0[2] + i),
                   load3<D>(block.v1[0] + i, block.v1[1] + i, block.v1[2] + i),
                   load3<D>(block.v2[0] + i, block.v2[1] + i, block.v2[2] + i), o, d, group_t, group_u, group_v);
    if (!bits) continue;
    group_t.store(t + i), group_u.store(u + i), group_v.store(v + i);
    inside |= bits << i;
  }
  if (inside) hits = {vf<W>::load(t), vf<W>::load(u), vf<W>::load(v), vf<W>(1.0f)};
  return vm<W>::from_bits(inside);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
