// Watertight ray/triangle intersection (Woop, Benthin, Wald, JCGT 2(1) 2013), with each edge decided by its two rounded
// products alone: the sign of their difference, which gradual underflow keeps, so the same as comparing them.
//
// Every vertex is translated, permuted and sheared once per (ray, vertex), alike in all triangles that share it, so the
// rounded 2-D mesh stays closed; rounding is monotone, so an exact Cx*By > Cy*Bx is never computed as <, and a tie is
// inside on both sides. The products must not be fused with their difference (-ffp-contract=off); the shear may, being
// one expression for every vertex. A tie may be rounding alone, and then a triangle far beside the ray would be taken
// for hit (small triangles seen from a great distance): in lanes that pass with a tie, double products, exact for float
// inputs, decide, as in the paper.
//
// t is a mean of the vertices' depths, so its error grows with their distance, not with t: beside a large triangle a
// ray that starts on it could meet it again. So t has a bound, and where that does not suffice it is computed again.
//
// Let u = 2^-24, L and Z the largest sheared coordinate across and depth, s the largest less the smallest depth in
// units of t, R the sum of the squares of all nine sheared coordinates.
// 1. A sheared x or y is off by delta = u (2 L + 3 Z), or u (2 L + 4 Z) unfused (exact_filter.h): less than
//    4.5 u sqrt(R).
// 2. An edge function of corners b and c is off by sqrt(2) delta (|b| + |c|), and by 2 u |b| |c| in its own roundings.
// 3. Where the ray meets the triangle these move t by their sum times |depth - t| / |det|: s times those of two edges
//    at most, (15.6 + 1.5) u R s / |det|. The other roundings of t are under 9 u max |depth| <= 9 u (s + |t|), and
//    |det| <= R. So the error of t is below 27 u R s / |det| + 9 u |t|: but for the last term, which is t's own
//    rounding, within 2^-19 R s / |det|.
// 4. The products that t is a sum of may underflow: by less than 2^-147 / |det| in all. That is more than t's rounding
//    where |det| (t - tnear) is below 2^-124.
// 5. Where 3 or 4 could turn t across tnear, 3 only where t is closer to tnear than 2^-10 of s, t is computed again,
//    from the triangle's plane, in double, and kept between the nearest and the farthest corner: a triangle that is met
//    only because its corners are rounded, edge on, has its plane anywhere along the ray, and must close the surface
//    all the same. What lies clearly before tnear, as the triangle that a ray has just left, is not computed again.
// 6. The mean itself, of the rounded corners, is where the ray is within delta of a point of the triangle: within its
//    box, as pads have it, in whatever structure. What the edge functions' own roundings move it by is 6 u s A / |det|,
//    A the sum of the squares across: for a triangle seen edge on, or long and thin, any share of s, and boxes might
//    cull what lies so far before them. Their pads are 8 u m or more, m the largest |depth| in units of t. So where
//    |det| m is below 2^-8 s A the mean is made of doubles, whose roundings are nothing beside it, and a distance of 5
//    is kept where the ray is in the triangle's box, or left to the mean where the ray is in the plane. (By the bound
//    that would have to be 2^0, by what is measured 2^-4 or so; but the doubles of large walls are dear.)
#pragma once

#include <algorithm>
#include <limits>

#include "intersectors/sheared_packet.h"
#include "intersectors/triangle_hits.h"
#include "simd/double.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

struct Watertight {
  static constexpr std::string_view kName = "watertight";
  static constexpr bool reads(TriangleForm form) { return form == TriangleForm::vertices; }
  static constexpr bool kEveryLeaf = true;
  /// t is a mean of the corners' distances, or the plane's kept between them; what is rounded are the sheared x and y.
  static constexpr bool kDepthBetweenCorners = true;

  using RayData = ShearedRay;

  template <class Block>
  static ARBORETUM_INLINE auto intersect(const ShearedRay& given, const Block& block,
                                         TriangleHits<Block::kWidth>& hits) {
    constexpr int W = Block::kWidth;
    const ShearedRay& ray = given.in_memory();
    const Edges<W> e(ShearedVertices<W>(ray, block));
    vm<W> inside = e.inside();
    if (const unsigned met = inside.bits()) {
      const unsigned open = met & ~e.hits(vf<W>(ray.tnear()), vf<W>(ray.shear[2]), hits).bits();
      // What the rare functions are handed is copied, or read from memory again: a reference to the vectors here would
      // keep all of them in memory.
      if (__builtin_expect(open != 0, 0)) {
        if (__builtin_expect(any(inside & e.in_doubt(vf<W>(ray.shear[2]))), 0)) {
          TriangleHits<W> decided = hits;
          inside = decide_in_double(inside, ray, block, decided);
          hits = decided;
        } else {
          hits.t = plane_distances_in_double(open, ray, block, hits.t);
        }
      }
    }
    return inside;
  }

#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
  template <class Block>
  using ForTwoRays = const Block&;
  template <class Block>
  static ARBORETUM_INLINE vm<16> intersect_two(const ShearedRay& low, const ShearedRay& high, const Block& block,
                                               TriangleHits<16>& hits) {
    const Edges<16> e(ShearedVertices<16>(low, high, block));
    vm<16> inside = e.inside();
    if (const unsigned met = inside.bits()) {
      const vf<16> sz = in_halves(low.shear[2], high.shear[2]);
      const unsigned open = met & ~e.hits(in_halves(low.tnear(), high.tnear()), sz, hits).bits();
      if (__builtin_expect(open != 0, 0)) {
        TriangleHits<16> settled = hits;
        inside = settle_two(open, inside & e.in_doubt(sz), inside, low, high, block, settled);
        hits = settled;
      }
    }
    return inside;
  }
#endif

  struct PacketData : ShearedPacket {
    /// RayData of ray i.
    [[nodiscard]] ARBORETUM_INLINE RayData alone(const Ray& ray, int i) const {
      return RayData(ray, axis(i), sx[i], sy[i], sz[i]);
    }
  };

  /// Lanes are the W rays from k on, those of `in` against triangle `i` of the block: what intersect() computes, bit
  /// for bit. `again`: rays for which doubles must decide whether they hit, to be tested one by one.
  template <int W, class Block>
  static ARBORETUM_INLINE unsigned intersect_rays(const PacketRays& rays, const PacketData& shears, int kz, int k,
                                                  unsigned in, const Block& block, int i, TriangleHits<W>& hits,
                                                  unsigned& again) {
    using F = vf<W>;
    const Edges<W> e(shears.template sheared<W>(rays, kz, k, block, i));
    const unsigned inside = in & e.inside().bits();
    again = 0;
    if (inside == 0) return 0;
    const unsigned open = inside & ~e.hits(F::load(rays.tnear + k), F::load(shears.sz + k), hits).bits();
    if (__builtin_expect(open != 0, 0)) {
      again = open & e.in_doubt(F::load(shears.sz + k)).bits();
      if (const unsigned close = open & ~again) hits.t = plane_distances_of_rays(close, rays, kz, k, block, i, hits.t);
    }
    return inside & ~again;
  }

 private:
  template <int W>
  struct Edges {
    using F = vf<W>;
    ShearedVertices<W> p;
    F u, v, w;
    F sides;  ///< the least of the three times the largest: negative where they have different signs

    ARBORETUM_INLINE explicit Edges(const ShearedVertices<W>& vertices) : p(vertices) {
      u = p.c.x * p.b.y - p.c.y * p.b.x, v = p.a.x * p.c.y - p.a.y * p.c.x, w = p.b.x * p.a.y - p.b.y * p.a.x;
      sides = min_x86(min_x86(u, v), w) * max_x86(max_x86(u, v), w);
    }
    /// Also lanes in which the product has underflowed, on whichever side: ties(), which doubles decide. Of triangles
    /// below some 1e-11 those are most.
    ARBORETUM_INLINE vm<W> inside() const { return sides >= F(0.0f); }
    /// Of lanes inside, those in which an edge is met, or may be.
    ARBORETUM_INLINE vm<W> ties() const { return sides == F(0.0f); }
    /// And those whose mean floats round too far away.
    ARBORETUM_INLINE vm<W> in_doubt(F sz) const {
      const F za = sz * p.a.z, zb = sz * p.b.z, zc = sz * p.c.z;
      return ties() | (edge_on(across(), abs(u + v + w), nearest(za, zb, zc), farthest(za, zb, zc)) >= F(0.0f));
    }

    /// Sets the hits; returns the lanes that, if inside, are decided: no edge is met, and t is as right as it must be.
    ARBORETUM_INLINE vm<W> hits(F tnear, F sz, TriangleHits<W>& out) const {
      const F det = u + v + w, za = sz * p.a.z, zb = sz * p.b.z, zc = sz * p.c.z;
      out.t = (u * za + v * zb + w * zc) / det;
      out.u_numerator = v, out.v_numerator = w, out.denominator = det;
      return (sides != F(0.0f)) & clear<true>(tnear, nearest(za, zb, zc), farthest(za, zb, zc), det, out.t);
    }
    static ARBORETUM_INLINE F nearest(F a, F b, F c) { return min_x86(min_x86(a, b), c); }
    static ARBORETUM_INLINE F farthest(F a, F b, F c) { return max_x86(max_x86(a, b), c); }
    /// What the products that t is a sum of may lose, less than 2^-147, is no more than 2^-23 of this.
    static constexpr float kUnderflow = 0x1p-124f;
    /// Lanes whose t need not be computed again in double for tnear's sake, nor, where asked, for the triangle being
    /// seen edge on; none where it has overflowed.
    template <bool AndEdgeOn>
    ARBORETUM_INLINE vm<W> clear(F tnear, F near, F far, F det, F t) const {
      const F spread = far - near, area = abs(det);
      const F sideways = across();
      const F size = madd(p.a.z, p.a.z, madd(p.b.z, p.b.z, madd(p.c.z, p.c.z, sideways)));
      const F beyond = (t - madd(t, F(0.0f), tnear)) * area, error = F(0x1p-19f) * size;  // NaN of an infinite t
      F behind = msub(spread, max_x86(error, F(0x1p-10f) * area), beyond - F(kUnderflow));
      if constexpr (AndEdgeOn) behind = max_x86(edge_on(sideways, area, near, far), behind);
      return min_x86(madd(spread, error, beyond + F(kUnderflow)), behind) < F(0.0f);
    }

   private:
    /// The squares of what the corners are across the ray.
    ARBORETUM_INLINE F across() const {
      const auto squares = [](const vf3<W>& q, F more) { return madd(q.x, q.x, madd(q.y, q.y, more)); };
      return squares(p.a, squares(p.b, madd(p.c.x, p.c.x, p.c.y * p.c.y)));
    }
    /// Negative but where a triangle is seen edge on, or is long and thin.
    static ARBORETUM_INLINE F edge_on(F sideways, F area, F near, F far) {
      return msub(F(0x1p-8f) * (far - near), sideways, max_abs(near, far) * area);
    }
  };

#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
  /// What intersect() does with lanes that are open, for each of the two rays.
  template <class Block>
  static __attribute__((noinline)) vm<16> settle_two(unsigned open, vm<16> in_doubt, vm<16> inside,
                                                     const ShearedRay& low, const ShearedRay& high, const Block& block,
                                                     TriangleHits<16>& hits) {
    TriangleHits<8> half[2] = {
        {lower_half(hits.t), lower_half(hits.u_numerator), lower_half(hits.v_numerator), lower_half(hits.denominator)},
        {upper_half(hits.t), upper_half(hits.u_numerator), upper_half(hits.v_numerator), upper_half(hits.denominator)}};
    unsigned met = inside.bits();
    for (int i = 0; i < 2; ++i) {
      const auto lanes = [shift = 8 * i](unsigned bits) { return bits >> shift & 0xffu; };
      if (lanes(open) == 0) continue;
      const ShearedRay& ray = i == 0 ? low : high;
      if (lanes(in_doubt.bits()) != 0) {
        const unsigned hit = decide_in_double(vm<8>::from_bits(lanes(met)), ray, block, half[i]).bits();
        met ^= (lanes(met) ^ hit) << 8 * i;
      } else {
        half[i].t = plane_distances_in_double(lanes(open), ray, block, half[i].t);
      }
    }
    hits = {in_halves(half[0].t, half[1].t), in_halves(half[0].u_numerator, half[1].u_numerator),
            in_halves(half[0].v_numerator, half[1].v_numerator), in_halves(half[0].denominator, half[1].denominator)};
    return vm<16>::from_bits(met);
  }
#endif

  /// The lanes of `inside` that are hit when ties are decided in double; sets their hits and those of triangles seen
  /// edge on, and distances close to tnear, again.
  template <class Block>
  static __attribute__((noinline)) vm<Block::kWidth> decide_in_double(vm<Block::kWidth> inside, const ShearedRay& ray,
                                                                      const Block& block,
                                                                      TriangleHits<Block::kWidth>& hits) {
    constexpr int W = Block::kWidth;
    using F = vf<W>;
    const Edges<W> e(ShearedVertices<W>(ray, block));
    const F tnear(ray.tnear()), sz(ray.shear[2]);
    // Those that are decided stay as they are: they must not depend on their neighbours.
    TriangleHits<W> same;
    unsigned hit = inside.bits();
    const unsigned doubt = hit & ~e.hits(tnear, sz, same).bits() & e.in_doubt(sz).bits();
    float p[9][W], out[4][W];
    const F in[9] = {e.p.a.x, e.p.a.y, e.p.a.z, e.p.b.x, e.p.b.y, e.p.b.z, e.p.c.x, e.p.c.y, e.p.c.z};
    for (int i = 0; i < 9; ++i) in[i].store(p[i]);
    hits.t.store(out[0]), hits.u_numerator.store(out[1]), hits.v_numerator.store(out[2]),
        hits.denominator.store(out[3]);
    for (unsigned rest = doubt; rest; rest &= rest - 1) {
      const int i = __builtin_ctz(rest);
      const double u = double(p[6][i]) * p[4][i] - double(p[7][i]) * p[3][i];
      const double v = double(p[0][i]) * p[7][i] - double(p[1][i]) * p[6][i];
      const double w = double(p[3][i]) * p[1][i] - double(p[4][i]) * p[0][i];
      const double det = u + v + w;
      const bool one_side = (u >= 0 && v >= 0 && w >= 0) || (u <= 0 && v <= 0 && w <= 0);
      if (!one_side || det == 0) {
        hit &= ~(1u << i);
        continue;
      }
      out[0][i] = float((u * p[2][i] + v * p[5][i] + w * p[8][i]) / det * ray.shear[2]);
      out[1][i] = float(v / det), out[2][i] = float(w / det), out[3][i] = 1.0f;
    }
    const F t = F::load(out[0]);
    const F za = sz * e.p.a.z, zb = sz * e.p.b.z, zc = sz * e.p.c.z;
    const vm<W> clear =
        e.template clear<false>(tnear, e.nearest(za, zb, zc), e.farthest(za, zb, zc), e.u + e.v + e.w, t);
    const unsigned near = hit & ~clear.bits();
    float distances[W];
    plane_distances_in_double(near, ray, block, t).store(distances);
    for (unsigned rest = near & doubt; rest; rest &= rest - 1) {
      const int i = __builtin_ctz(rest);
      distances[i] = within_box(distances[i], out[0][i], ray, block, i);
    }
    hits = {F::load(distances), F::load(out[1]), F::load(out[2]), F::load(out[3])};
    return vm<W>::from_bits(hit);
  }
  /// `t`, where the ray meets the plane of triangle i of the block, but no earlier and no later than the ray is in its
  /// box, padded along each axis by 2^-22 of the distance from the origin; `mean` where it never is, or is in the plane
  /// to 2^-20, which then says nothing.
  template <class Block>
  static float within_box(float t, float mean, const ShearedRay& ray, const Block& block, int i) {
    const std::uint32_t rows[3] = {ray.order->x, ray.order->y, ray.order->z};
    double first = -std::numeric_limits<double>::infinity(), last = -first;
    double d[3], e1[3], e2[3];
    for (int a = 0; a < 3; ++a) {
      const auto seen = [&](const float(&p)[3][Block::kWidth]) {
        return double(ShearedRay::row(p, rows[a])[i]) - double(ray.from[a]);
      };
      const double p0 = seen(block.v0), p1 = seen(block.v1), p2 = seen(block.v2);
      d[a] = ray.direction[a], e1[a] = p1 - p0, e2[a] = p2 - p0;
      if (d[a] == 0) continue;
      const auto [low, high] = std::minmax({p0, p1, p2});
      const double pad = 0x1p-22 * std::max(-low, high);
      const auto [enter, leave] = std::minmax({(low - pad) / d[a], (high + pad) / d[a]});
      first = std::max(first, enter), last = std::min(last, leave);
    }
    const double n[3] = {e1[1] * e2[2] - e1[2] * e2[1], e1[2] * e2[0] - e1[0] * e2[2], e1[0] * e2[1] - e1[1] * e2[0]};
    const auto dot = [](const double* p, const double* q) { return p[0] * q[0] + p[1] * q[1] + p[2] * q[2]; };
    const double along = dot(n, d);
    if (!(first <= last) || along * along < 0x1p-40 * dot(n, n) * dot(d, d)) return mean;
    return float(std::clamp(double(t), first, last));
  }

  /// Where a ray along d meets a triangle's plane, N.a / N.d, but between the nearest and the farthest corner; a: the
  /// first corner as seen from the ray's origin; e1, e2: edges from it. Axes in the ray's order. `usable`: lanes where
  /// N.d is not 0.
  template <int D>
  static ARBORETUM_INLINE vd<D> plane_distance(const vd3<D>& a, const vd3<D>& e1, const vd3<D>& e2, const vd3<D>& d,
                                               unsigned& usable) {
    using F = vd<D>;
    // Not fused: most of these products are exact, and what is 0 then comes out as 0, as of a ray that starts in the
    // plane.
    const auto dot_unfused = [](const vd3<D>& p, const vd3<D>& q) { return p.x * q.x + p.y * q.y + p.z * q.z; };
    const vd3<D> n{e1.y * e2.z - e1.z * e2.y, e1.z * e2.x - e1.x * e2.z, e1.x * e2.y - e1.y * e2.x};
    const F along = dot_unfused(n, d);
    usable = along != F(0.0);
    // Rounded division keeps the order: those of the nearest and the farthest corner are the least and the greatest.
    const F b = a.z + e1.z, c = a.z + e2.z, low = min_x86(min_x86(a.z, b), c) / d.z,
            high = max_x86(max_x86(a.z, b), c) / d.z;
    return max_x86(min_x86(dot_unfused(n, a) / along, max_x86(low, high)), min_x86(low, high));
  }
  /// `distances`, those of `lanes` from `distance(first, usable)`, plane_distance() of the D lanes from `first` on.
  template <int W, class Distance>
  static ARBORETUM_INLINE vf<W> with_plane_distances(unsigned lanes, const Distance& distance, vf<W> distances) {
    constexpr int D = kDoubleLanes<W>;
    vd<D> t[W / D];
    for (int k = 0; k < W / D; ++k) {
      t[k] = 0.0;
      const unsigned asked = lanes >> k * D & ((1u << D) - 1u);
      if (asked == 0) continue;
      unsigned usable;
      t[k] = distance(k * D, usable);
      lanes &= ~((asked & ~usable) << k * D);
    }
    return select(vm<W>::from_bits(lanes), to_floats<W>(t), distances);
  }

  /// `distances`, in the lanes that `lanes` names computed in double from the triangles' planes.
  template <class Block>
  static __attribute__((noinline)) vf<Block::kWidth> plane_distances_in_double(unsigned lanes, const ShearedRay& ray,
                                                                               const Block& block,
                                                                               vf<Block::kWidth> distances) {
    constexpr int W = Block::kWidth, D = kDoubleLanes<W>;
    const AxisOrder& axes = *ray.order;
    const vd3<D> o{double(ray.from[0]), double(ray.from[1]), double(ray.from[2])},
        d{double(ray.direction[0]), double(ray.direction[1]), double(ray.direction[2])};
    const auto distance = [&](int k, unsigned& usable) {
      const auto corner = [&](const float(&p)[3][W]) {
        return load3<D>(ShearedRay::row(p, axes.x) + k, ShearedRay::row(p, axes.y) + k, ShearedRay::row(p, axes.z) + k);
      };
      const vd3<D> v0 = corner(block.v0);
      return plane_distance<D>(v0 - o, corner(block.v1) - v0, corner(block.v2) - v0, d, usable);
    };
    return with_plane_distances<W>(lanes, distance, distances);
  }
  /// The same for the W rays from k on, of group kz, and triangle `i` of the block.
  template <int W, class Block>
  static __attribute__((noinline)) vf<W> plane_distances_of_rays(unsigned lanes, const PacketRays& rays, int kz, int k,
                                                                 const Block& block, int i, vf<W> distances) {
    constexpr int D = kDoubleLanes<W>;
    const int kx = kz == 2 ? 0 : kz + 1, ky = kx == 2 ? 0 : kx + 1;
    const auto corner = [&](const float(&p)[3][Block::kWidth]) {
      return vd3<D>{double(p[kx][i]), double(p[ky][i]), double(p[kz][i])};
    };
    const vd3<D> v0 = corner(block.v0), e1 = corner(block.v1) - v0, e2 = corner(block.v2) - v0;
    const auto distance = [&](int at, unsigned& usable) {
      const auto of_rays = [&](const float(&p)[3][PacketRays::kMost]) {
        return load3<D>(p[kx] + k + at, p[ky] + k + at, p[kz] + k + at);
      };
      return plane_distance<D>(v0 - of_rays(rays.origin), e1, e2, of_rays(rays.direction), usable);
    };
    return with_plane_distances<W>(lanes, distance, distances);
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
