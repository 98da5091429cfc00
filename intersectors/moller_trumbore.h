// Moeller and Trumbore (JGT 1997), in the factorisation that shares C x d between u and v and divides last (as Kensler
// and Shirley 2006): C = v0 - o, R = C x d, N = (v1 - v0) x (v2 - v0); u = R.e2 / N.d, v = R.e1 / N.d, t = N.C / N.d
// with e1 = v0 - v1 and e2 = v2 - v0. Fast; leaks at shared edges, since the two sides' u and v are different sums.
#pragma once

#include "intersectors/triangle_hits.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// What the test needs of a triangle and a line, in float or double: N, C, N.d, and u and v times N.d.
template <class F>
struct MollerTrumboreTerms {
  vec3<F> n, c;
  F det, u, v;
  ARBORETUM_INLINE MollerTrumboreTerms(vec3<F> v0, vec3<F> e1, vec3<F> e2, vec3<F> o, vec3<F> d) : n(cross(e2, e1)), c(v0 - o) {
    const vec3<F> r = cross(c, d);
    det = dot(n, d), u = dot(r, e2), v = dot(r, e1);
  }
};

struct MollerTrumbore {
  static constexpr std::string_view kName = "moller_trumbore";
  static constexpr bool reads(TriangleForm form) { return form == TriangleForm::edges || form == TriangleForm::vertices; }
  static constexpr bool kEveryLeaf = true;

  /// One ray's constants.
  struct RayData {
    Vec3f origin, direction;
    ARBORETUM_INLINE explicit RayData(const Ray& ray) : origin(ray.origin), direction(ray.direction) {}
  };

  /// Lanes whose closed triangle the line meets, whatever t is; `hits` is set only where that is any lane.
  template <class Block>
  static ARBORETUM_INLINE auto intersect(const RayData& ray, const Block& block, TriangleHits<Block::kWidth>& hits) {
    constexpr int W = Block::kWidth;
    using F = vf<W>;
    const vf3<W> v0{F::load(block.v0[0]), F::load(block.v0[1]), F::load(block.v0[2])};
    vf3<W> e1, e2;
    if constexpr (Block::kForm == TriangleForm::edges) {
      e1 = {F::load(block.e1[0]), F::load(block.e1[1]), F::load(block.e1[2])};
      e2 = {F::load(block.e2[0]), F::load(block.e2[1]), F::load(block.e2[2])};
    } else {
      e1 = v0 - vf3<W>{F::load(block.v1[0]), F::load(block.v1[1]), F::load(block.v1[2])};
      e2 = vf3<W>{F::load(block.v2[0]), F::load(block.v2[1]), F::load(block.v2[2])} - v0;
    }
    return core<W>({F(ray.origin.x), F(ray.origin.y), F(ray.origin.z)}, {F(ray.direction.x), F(ray.direction.y), F(ray.direction.z)}, v0, e1, e2, hits);
  }

  /// What a packet keeps beside its rays: nothing.
  struct PacketData {
    static constexpr int kGroups = 1;
    void clear() {}
    template <int W>
    void prepare(const PacketRays&, int /*k*/) {}
    [[nodiscard]] std::uint64_t group(int) const { return ~std::uint64_t{0}; }
    /// RayData of ray i.
    [[nodiscard]] ARBORETUM_INLINE RayData alone(const Ray& ray, int /*i*/) const { return RayData(ray); }
  };

  /// Lanes are the W rays from k on, all against triangle `i` of the block: what intersect() computes, bit for bit. `again`: rays that must be
  /// tested one by one instead; here none.
  template <int W, class Block>
  static ARBORETUM_INLINE vm<W> intersect_rays(const PacketRays& rays, const PacketData&, int /*group*/, int k, const Block& block, int i, TriangleHits<W>& hits, vm<W>& again) {
    using F = vf<W>;
    const auto all = [i](const float(&p)[3][Block::kWidth]) { return vf3<W>{F(p[0][i]), F(p[1][i]), F(p[2][i])}; };
    const auto load = [k](const float(&p)[3][PacketRays::kMost]) { return vf3<W>{F::load(p[0] + k), F::load(p[1] + k), F::load(p[2] + k)}; };
    const vf3<W> v0 = all(block.v0);
    vf3<W> e1, e2;
    if constexpr (Block::kForm == TriangleForm::edges) {
      e1 = all(block.e1), e2 = all(block.e2);
    } else {
      e1 = v0 - all(block.v1), e2 = all(block.v2) - v0;
    }
    again = vm<W>(false);
    return core<W>(load(rays.origin), load(rays.direction), v0, e1, e2, hits);
  }

 private:
  template <int W>
  static ARBORETUM_INLINE vm<W> core(vf3<W> o, vf3<W> d, vf3<W> v0, vf3<W> e1, vf3<W> e2, TriangleHits<W>& hits) {
    using F = vf<W>;
    const MollerTrumboreTerms<F> terms(v0, e1, e2, o, d);
    const F det = terms.det, abs_det = abs(det);
    const vi<W> sign = sign_bits(det);
    const F u = xor_sign(terms.u, sign), v = xor_sign(terms.v, sign);
    const vm<W> inside = (u >= F(0.0f)) & (v >= F(0.0f)) & (u + v <= abs_det) & (det != F(0.0f));
    if (any(inside)) {
      hits.t = xor_sign(dot(terms.n, terms.c), sign) / abs_det;
      hits.u_numerator = u, hits.v_numerator = v, hits.denominator = abs_det;
    }
    return inside;
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
