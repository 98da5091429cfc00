// The Pluecker test (intersectors/pluecker.h) on float32 corners widened to double; t, u and v are rounded to float at
// the end. As there, no ray slips through an edge, and one in ten thousand or so aimed at a vertex can; t is right to
// half a unit in the last place, and a little, unless the ray grazes: its relative error is some 2^-50 times
// |e1||e2||d| / |N.d|. 36 bytes a triangle (vertices) or 12 (indices).
#pragma once

#include "intersectors/double_block.h"
#include "intersectors/pluecker.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

struct PlueckerDouble {
  static constexpr std::string_view kName = "pluecker_double";
  static constexpr bool reads(TriangleForm form) { return form == TriangleForm::vertices; }
  static constexpr bool kEveryLeaf = false;

  using RayData = RayInDouble;

  template <class Block>
  static ARBORETUM_INLINE auto intersect(const RayData& ray, const Block& block, TriangleHits<Block::kWidth>& hits) {
    return intersect_in_double<PlueckerDouble>(ray, block, hits);
  }

  template <class F>
  static ARBORETUM_INLINE unsigned test(vec3<F> v0, vec3<F> v1, vec3<F> v2, vec3<F> o, vec3<F> d, F& t, F& u, F& v) {
    const vec3<F> p0 = v0 - o;
    const PlueckerTerms<F> terms(p0, v1 - o, v2 - o, d);
    const F sum = terms.sum();
    unsigned inside = terms.one_side() & (sum != F(0.0));
    if (inside) {
      const vec3<F> n = terms.normal();
      const F det = dot(n, d);
      inside &= det != F(0.0);
      t = dot(n, p0) / det, u = terms.u / sum, v = terms.v / sum;
    }
    return inside;
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
