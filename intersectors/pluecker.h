// Pluecker test in the edge x (sum of end points) form, as Embree's robust mode has it, with strict signs: translated
// vertices p_i = v_i - o; U = d.((p2 - p0) x (p2 + p0)), V and W likewise. A shared edge gives its two triangles values
// of exactly opposite sign (the difference flips, the sum commutes), so no ray slips through an edge; three edges that
// meet at a vertex round apart, so a ray at a vertex can. No tolerance: Embree's adds false hits.
#pragma once

#include "intersectors/triangle_hits.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// What the test needs of three corners relative to the origin and a direction, in float or double: the edges that face
/// corners 1 and 2, and the three edge functions.
template <class F>
struct PlueckerTerms {
  vec3<F> edge_u, edge_v;
  F u, v, w;
  ARBORETUM_INLINE PlueckerTerms(vec3<F> p0, vec3<F> p1, vec3<F> p2, vec3<F> d) : edge_u(p2 - p0), edge_v(p0 - p1) {
    u = dot(cross(edge_u, p2 + p0), d);
    v = dot(cross(edge_v, p0 + p1), d);
    w = dot(cross(p1 - p2, p1 + p2), d);
  }
};

struct Pluecker {
  static constexpr std::string_view kName = "pluecker";
  static constexpr bool reads(TriangleForm form) { return form == TriangleForm::vertices; }
  static constexpr bool kEveryLeaf = false;

  using RayData = RayLine;

  template <class Block>
  static ARBORETUM_INLINE auto intersect(const RayData& ray, const Block& block, TriangleHits<Block::kWidth>& hits) {
    constexpr int W = Block::kWidth;
    using F = vf<W>;
    const vf3<W> o = in_all_lanes<W>(ray.origin), d = in_all_lanes<W>(ray.direction);
    const vf3<W> p0 = vf3<W>{F::load(block.v0[0]), F::load(block.v0[1]), F::load(block.v0[2])} - o;
    const vf3<W> p1 = vf3<W>{F::load(block.v1[0]), F::load(block.v1[1]), F::load(block.v1[2])} - o;
    const vf3<W> p2 = vf3<W>{F::load(block.v2[0]), F::load(block.v2[1]), F::load(block.v2[2])} - o;
    const PlueckerTerms<F> terms(p0, p1, p2, d);
    const F u = terms.u, v = terms.v, w = terms.w;
    const F smallest = min_x86(min_x86(u, v), w), largest = max_x86(max_x86(u, v), w);
    const F sum = u + v + w;
    vm<W> inside = ((smallest >= F(0.0f)) | (largest <= F(0.0f))) & (sum != F(0.0f));
    if (any(inside)) {
      const vf3<W> n = cross(terms.edge_u, terms.edge_v);  // (v1 - v0) x (v2 - v0)
      F det = dot(n, d), numerator = dot(n, p0);
      // Of a tiny triangle, or close to one, they underflow. With n times a power of two they are the same, but for
      // that.
      const vm<W> tiny =
          (min_x86(abs(det), abs(numerator)) < F(0x1p-100f)) & (abs(n.x) + abs(n.y) + abs(n.z) < F(0x1p-20f));
      if (__builtin_expect(any(inside & tiny), 0)) {
        const F up(0x1p64f);
        const vf3<W> larger{n.x * up, n.y * up, n.z * up};
        det = select(tiny, dot(larger, d), det), numerator = select(tiny, dot(larger, p0), numerator);
      }
      inside = inside & (det != F(0.0f));
      hits.t = numerator / det;
      hits.u_numerator = u, hits.v_numerator = v, hits.denominator = sum;
    }
    return inside;
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
