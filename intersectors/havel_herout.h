// Havel and Herout (IEEE TVCG 16(3) 2010): three planes a triangle, computed with the tree. With the triangle's plane
// n0.p = d0, det = n0.d and t' = d0 - n0.o give t = t' / det and the hit point times det, D = det o + t' d; the other
// planes of D are u and v times det. Nothing is divided but the t of a hit. 48 bytes a triangle. Ours scales the first
// plane by a power of two (intersectors/precomputed.h).
//
// Leaks along edges and vertices, more than any other here, since u and v of D cancel the products with det; t is off
// by no more than 2^-21 (|o| + |v0| + |t d|) / (|N.d| / |N|max), sums of absolute components meant. Precise near the
// origin alone.
#pragma once

#include "intersectors/triangle_hits.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

struct HavelHerout {
  static constexpr std::string_view kName = "havel_herout";
  static constexpr bool reads(TriangleForm form) { return form == TriangleForm::planes; }
  static constexpr bool kEveryLeaf = true;

  using RayData = RayLine;

  template <class Block>
  static ARBORETUM_INLINE auto intersect(const RayData& ray, const Block& block, TriangleHits<Block::kWidth>& hits) {
    constexpr int W = Block::kWidth;
    using F = vf<W>;
    const auto normal = [&block](int i) {
      return vf3<W>{F::load(block.number[i]), F::load(block.number[i + 1]), F::load(block.number[i + 2])};
    };
    const auto offset = [&block](int i) { return F::load(block.number[i + 3]); };
    const vf3<W> o = in_all_lanes<W>(ray.origin), d = in_all_lanes<W>(ray.direction);
    const vf3<W> n = normal(0);
    const F det = dot(n, d), t = offset(0) - dot(n, o);
    const vf3<W> p{madd(det, o.x, t * d.x), madd(det, o.y, t * d.y), madd(det, o.z, t * d.z)};
    const vi<W> sign = sign_bits(det);
    const F u = xor_sign(madd(det, offset(4), dot(normal(4), p)), sign),
            v = xor_sign(madd(det, offset(8), dot(normal(8), p)), sign);
    const F abs_det = abs(det);
    const vm<W> inside = (u >= F(0.0f)) & (v >= F(0.0f)) & (u + v <= abs_det) & (det != F(0.0f));
    if (any(inside)) hits = {xor_sign(t, sign) / abs_det, u, v, abs_det};
    return inside;
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
