// Baldwin and Weber (JCGT 5(3) 2016): an affine map, computed with the tree, takes the triangle to (0,0,0), (1,0,0),
// (0,1,0). The ray is where its third coordinate vanishes: t = -height(o) / height(d); the point there has the
// barycentrics as its first two. One column of the map is a column of the identity; the paper leaves it out and
// branches over which one it is. Lanes cannot branch, so the column stands in the block (wald_projection leaves it out
// and selects instead). 48 bytes a triangle.
//
// Leaks along edges, and the map's offsets are as large as the triangle is far from the origin: t is off by no more
// than 2^-21 (|o| + |v0| + |t d|) / |height(d)|, sums of absolute components meant. Precise near the origin alone.
#pragma once

#include "intersectors/triangle_hits.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

struct BaldwinWeber {
  static constexpr std::string_view kName = "baldwin_weber";
  static constexpr bool reads(TriangleForm form) { return form == TriangleForm::transform; }
  static constexpr bool kEveryLeaf = true;

  using RayData = RayLine;

  template <class Block>
  static ARBORETUM_INLINE auto intersect(const RayData& ray, const Block& block, TriangleHits<Block::kWidth>& hits) {
    constexpr int W = Block::kWidth;
    using F = vf<W>;
    const auto row = [&block](int i) {
      return vf3<W>{F::load(block.number[i]), F::load(block.number[i + 1]), F::load(block.number[i + 2])};
    };
    const vf3<W> o = in_all_lanes<W>(ray.origin), d = in_all_lanes<W>(ray.direction);
    const vf3<W> height = row(8);
    // A line in the plane, or in one parallel to it, makes t infinite or NaN, and the point with it: not inside.
    const F t = -(dot(height, o) + F::load(block.number[11])) / dot(height, d);
    const vf3<W> p{madd(t, d.x, o.x), madd(t, d.y, o.y), madd(t, d.z, o.z)};
    const F u = dot(row(0), p) + F::load(block.number[3]), v = dot(row(4), p) + F::load(block.number[7]);
    hits = {t, u, v, F(1.0f)};
    return (u >= F(0.0f)) & (v >= F(0.0f)) & (u + v <= F(1.0f));
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
