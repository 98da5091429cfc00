// Moeller and Trumbore's test (intersectors/moller_trumbore.h) on float32 corners widened to double; t, u and v are
// rounded to float at the end. t is right to half a unit in the last place, and a little, unless the ray grazes: its
// relative error is some 2^-50 times |e1||e2||d| / |N.d|. Not watertight: the two sides of an edge still compute
// different sums, so a few in a million rays aimed at edges are lost, and a few in a thousand of those aimed at
// vertices. 36 bytes a triangle (vertices) or 12 (indices).
#pragma once

#include "intersectors/double_block.h"
#include "intersectors/moller_trumbore.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

struct MollerTrumboreDouble {
  static constexpr std::string_view kName = "moller_trumbore_double";
  static constexpr bool reads(TriangleForm form) { return form == TriangleForm::vertices; }
  static constexpr bool kEveryLeaf = false;

  using RayData = RayInDouble;

  template <class Block>
  static ARBORETUM_INLINE auto intersect(const RayData& ray, const Block& block, TriangleHits<Block::kWidth>& hits) {
    return intersect_in_double<MollerTrumboreDouble>(ray, block, hits);
  }

  template <class F>
  static ARBORETUM_INLINE unsigned test(vec3<F> v0, vec3<F> v1, vec3<F> v2, vec3<F> o, vec3<F> d, F& t, F& u, F& v) {
    const MollerTrumboreTerms<F> terms(v0, v0 - v1, v2 - v0, o, d);
    const F det = abs(terms.det);
    u = flip_sign(terms.u, terms.det), v = flip_sign(terms.v, terms.det);
    const unsigned inside = (min_x86(u, v) >= F(0.0)) & (det >= u + v) & (det != F(0.0));
    if (inside) t = flip_sign(dot(terms.n, terms.c), terms.det) / det, u = u / det, v = v / det;
    return inside;
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
