// Pluecker test in the edge x (sum of end points) form, as Embree's robust mode has it, with strict signs: translated
// vertices p_i = v_i - o; U = d.((p2 - p0) x (p2 + p0)), V and W likewise. A shared edge gives its two triangles values
// of exactly opposite sign (the difference flips, the sum commutes), so no ray slips through an edge; three edges that
// meet at a vertex round apart, so a ray at a vertex can. No tolerance: Embree's adds false hits.
//
// Products of three coordinates underflow where triangles are tiny. That turns no sign, and an edge function which
// becomes 0 is 0 on both sides, so inside on both. Where all three of a triangle are 0, doubles decide; what t is made
// of is made of doubles where it may have underflowed. No ray is lost by that: the neighbour of a triangle with three
// zeros either has them too, and on their common edge the same double with the opposite sign, or takes that edge's 0
// for inside.
#pragma once

#include "intersectors/triangle_hits.h"
#include "simd/double.h"

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
  /// Where none of them is on another side of 0 than the others.
  [[nodiscard]] ARBORETUM_INLINE auto one_side() const {
    const F least = min_x86(min_x86(u, v), w), largest = max_x86(max_x86(u, v), w);
    return (least >= F(0.0f)) | (F(0.0f) >= largest);
  }
  [[nodiscard]] ARBORETUM_INLINE F sum() const { return u + v + w; }
  /// (v1 - v0) x (v2 - v0)
  [[nodiscard]] ARBORETUM_INLINE vec3<F> normal() const { return cross(edge_u, edge_v); }
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
    const PlueckerTerms<F> e(p0, p1, p2, d);
    vm<W> inside = e.one_side();
    if (any(inside)) {
      const vf3<W> n = e.normal();
      const F sum = e.sum(), det = dot(n, d), numerator = dot(n, p0);
      hits.t = numerator / det;
      hits.u_numerator = e.u, hits.v_numerator = e.v, hits.denominator = sum;
      const vm<W> tiny =
          (min_x86(abs(det), abs(numerator)) < F(0x1p-60f)) & (abs(n.x) + abs(n.y) + abs(n.z) < F(0x1p-20f));
      const unsigned in_double = (inside & tiny).bits();
      inside = inside & (sum != F(0.0f)) & (det != F(0.0f));
      if (__builtin_expect(in_double != 0, 0)) {
        // Copied, as in intersectors/watertight.h
        TriangleHits<W> decided = hits;
        inside = decide_in_double(in_double, inside, ray, block, decided);
        hits = decided;
      }
    }
    return inside;
  }

 private:
  /// `inside` and `hits` with what doubles give in `lanes`: t, and where all edge functions are 0 all that there is.
  template <class Block>
  static __attribute__((noinline)) vm<Block::kWidth> decide_in_double(unsigned lanes, vm<Block::kWidth> inside,
                                                                      const RayData& ray, const Block& block,
                                                                      TriangleHits<Block::kWidth>& hits) {
    constexpr int W = Block::kWidth, D = kDoubleLanes<W>;
    using F = vd<D>;
    const auto in_all = [](Vec3f a) { return vd3<D>{F(double(a.x)), F(double(a.y)), F(double(a.z))}; };
    const vd3<D> o = in_all(ray.origin), d = in_all(ray.direction);
    const unsigned zero = (hits.denominator == vf<W>(0.0f)).bits();
    unsigned hit = 0;
    float t[W] = {}, u[W] = {}, v[W] = {};
    for (int k = 0; k < W; k += D) {
      if ((lanes >> k & ((1u << D) - 1u)) == 0) continue;
      const auto corner = [&](const float(&p)[3][W]) { return load3<D>(p[0] + k, p[1] + k, p[2] + k) - o; };
      const vd3<D> p0 = corner(block.v0);
      const PlueckerTerms<F> e(p0, corner(block.v1), corner(block.v2), d);
      const vd3<D> n = e.normal();
      const F det = dot(n, d), sum = e.sum();
      hit |= (det != F(0.0)) << k & ((e.one_side() & (sum != F(0.0))) << k | ~zero);
      (dot(n, p0) / det).store(t + k), (e.u / sum).store(u + k), (e.v / sum).store(v + k);
    }
    hit &= lanes;
    const vm<W> all = vm<W>::from_bits(hit), by_doubles = vm<W>::from_bits(hit & zero);
    hits.t = select(all, vf<W>::load(t), hits.t);
    hits.u_numerator = select(by_doubles, vf<W>::load(u), hits.u_numerator);
    hits.v_numerator = select(by_doubles, vf<W>::load(v), hits.v_numerator);
    hits.denominator = select(by_doubles, vf<W>(1.0f), hits.denominator);
    return vm<W>::from_bits((inside.bits() & ~lanes) | hit);
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
