// Exact: hit or miss, the nearest primitive (of equal distances the lowest id) and the rounded t are those of rational
// arithmetic on the float32 inputs. A float filter with a proved bound decides nearly all lanes; exact arithmetic
// (core/exact/hit_arithmetic.h) decides the others. The idea of a filter is Shewchuk's (Adaptive Precision, 1997); its
// form is the sheared one of Woop, Benthin and Wald (JCGT 2(1) 2013), as in watertight.h.
//
// The bound. u = 2^-24; p = (x, y, z) a vertex as seen from the origin (or its opposite, which has the same errors),
// permuted so that |d_z| is the largest; S = d_x / d_z, so |S| <= 1; x' = x - S z (y' likewise) the exact sheared
// vertex, x^ the computed one; Z, L the largest |z^| and |x^|, |y^| of a triangle. z^ and the difference x are off by u
// of themselves, S by u / 2; |x| <= |x'| + |z|. So the shear is off by
//   u (L + Z) + u Z + u Z / 2 + u L = u (2 L + 2.5 Z) < delta = u (2 L + 3 Z)   fused (what underflow adds, 2^-150, is
//   less than
// the slack u (L + Z / 2), or else so small that the last term of E holds it), with u Z more where the product is
// rounded.
//   An edge function U = x^_c y^_b - y^_c x^_b is then off by 4 L delta + 2 delta^2, and by its own roundings, 3 u L^2
//   fused and
// 4 u L^2 not: by less than u (12 L Z + 11 L^2) + 18 u^2 Z^2 + higher terms fused, and u (14 L Z + 12 L^2) + 25 u^2 Z^2
// not. Hence
//   E = k u (L + 7 u Z) (L + Z) + 2^-140,  k = 12.5 fused, 14.5 not:
// at least 3.5 % are left for E's own five roundings, and 2^-140 is more than all underflows. U, V, W all beyond E on
// one side: certainly hit; one beyond E, another beyond -E: certainly missed; else exact arithmetic. An overflow of z^,
// x^, y^ or of a product makes E infinite or NaN, since (L + 7 u Z) (L + Z) is no less than any product, and then
// nothing is certain. Denormals must not be flushed.
//
// Distances. With z in units of t (times 1 / d_z), t is the mean of the vertices' z with weights U / (U + V + W) >= 0.
// The weights' errors move it by less than (E / |U + V + W|) (|z_a - t| + |z_b - t| + |z_c - t|) <= 2 (E / |U + V + W|)
// (z_max - z_min); the roundings of weights, z and their sum by 4, 3 and 3 u max |z|, those of z_max - z_min by 4 u max
// |z| more, as E < |U + V + W| / 3. The interval about t is padded by 3 E / |U + V + W| (z_max - z_min) + 20 u max |z|
// + 2^-140. A hit that the filter has not decided lies within [z_min, z_max], padded by 8 u max |z|.
//
// The nearest. A hit is left out only when its interval lies beyond that of the best; where they overlap the exact
// distances are compared. best.t is the high end of the best hit's interval until finish(), so that no box in front of
// the exact t is culled. Nearly always the nearest candidate of a block is certainly hit, and its interval lies before
// all others: it is taken where the filter stands.
#pragma once

#include "core/exact/hit_arithmetic.h"
#include "intersectors/leaf_block.h"
#include "intersectors/round_later.h"
#include "intersectors/sheared_ray.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

struct Exact {
  static constexpr std::string_view kName = "exact";
  static constexpr bool reads(TriangleForm form) { return form == TriangleForm::vertices; }
  static constexpr bool kEveryLeaf = true;
  static constexpr bool kDepthBetweenCorners = true;

  /// The ray's constants, and the search's state: the best hit's corners and the low end of its interval.
  struct RayData : ShearedRay {
    Vec3f origin, towards;
    bool has_best = false;
    float best_low;  ///< of the ray while it has no hit
    CornersInFours best;

    ARBORETUM_INLINE explicit RayData(const Ray& ray)
        : ShearedRay(ray), origin(ray.origin), towards(ray.direction), best_low(ray.tfar) {
      // Where -1 / d_z is not within u of itself: NaN leaves every lane to exact arithmetic.
      const float largest = __builtin_fabsf(direction[2]);
      if (__builtin_expect(!(largest >= 0x1p-120f && largest <= 0x1p120f), 0))
        shear[0] = shear[2] = std::numeric_limits<float>::quiet_NaN();
    }
  };

#if ARBORETUM_TARGET != ARBORETUM_TARGET_SCALAR
  using Unfinished = UnroundedHits;
#endif

  /// True when `best` has changed.
  template <class Block>
  static ARBORETUM_INLINE bool closest_hit_block(RayData& ray, const Block& block, float tnear, NearestHit& best) {
    const Edges<Block::kWidth> edges = filter(ray, block);
    if (__builtin_expect(edges.candidates() == 0, 1)) return false;
    Distances<Block::kWidth> d;
    find_distances(ray, edges, tnear, best.t, d);
    if (d.candidates == 0) return false;
    const unsigned lane = foremost(d, tnear);
    if (__builtin_expect(lane != 0, 1)) {
      const int i = __builtin_ctz(lane);
      const float high = d.high[i];
      if (__builtin_expect(high < ray.best_low && high <= best.t, 1)) {
        ray.has_best = true, ray.best = CornersInFours(block, i), ray.best_low = d.low[i];
        best.t = high, best.primitive = std::int32_t(block.id[i]);
        return true;
      }
    }
    return nearest(ray, block, d, tnear, best);
  }

  template <class Block>
  static ARBORETUM_INLINE bool any_hit_block(RayData& ray, const Block& block, float tnear, float tfar) {
    const Edges<Block::kWidth> edges = filter(ray, block);
    if (__builtin_expect(edges.candidates() == 0, 1)) return false;
    Distances<Block::kWidth> d;
    find_distances(ray, edges, tnear, tfar, d);
    return d.candidates != 0 && any_within(ray, block, d, tnear, tfar);
  }

  /// Rounds t, u and v of the nearest hit.
  static ARBORETUM_INLINE void finish(RayData& ray, NearestHit& best) {
    if (!ray.has_best) return;
    RoundedHit hit;
    if (__builtin_expect(!round_in_double(ray.origin, ray.towards, ray.best, hit), 0))
      hit = round_exactly({ray.origin, 0.0f, ray.towards, best.t}, ray.best.corners());
    best.t = hit.t, best.u = hit.u, best.v = hit.v;
  }

 private:
  static constexpr float kBound = (kHasFma ? 12.5f : 14.5f) * 0x1p-24f;
  static constexpr float kLeast = 0x1p-140f;

  /// A block after the filter: sheared depths, edge functions, the least and the greatest of these, their bound.
  template <int W>
  struct Edges {
    vf<W> az, bz, cz, u, v, w, lowest, highest, error;

    /// Lanes that are not certainly missed. An error that is not finite misses nothing; an empty lane's depth is NaN,
    /// that of a triangle never.
    ARBORETUM_INLINE unsigned candidates() const {
      return (az == az).bits() & ~(min_x86(highest, -lowest) > error).bits();
    }
    ARBORETUM_INLINE vm<W> certainly_hit() const { return max_x86(lowest, -highest) > error; }
  };

  /// The candidates within an interval: t of lane i is within [low[i], high[i]] if it is hit; the `certain` lanes are.
  template <int W>
  struct Distances {
    unsigned candidates, certain;
    alignas(64) float low[W], high[W];
  };

  template <class Block>
  static ARBORETUM_INLINE Edges<Block::kWidth> filter(const RayData& ray, const Block& block) {
    using F = vf<Block::kWidth>;
    const ShearedVertices<Block::kWidth> p(ray.in_memory(), block);
    const auto [ax, ay, az] = p.a;
    const auto [bx, by, bz] = p.b;
    const auto [cx, cy, cz] = p.c;
    const F u = msub(cx, by, cy * bx), v = msub(ax, cy, ay * cx), w = msub(bx, ay, by * ax);
    const F width = max_x86(max_x86(max_x86(abs(ax), abs(ay)), max_x86(abs(bx), abs(by))), max_x86(abs(cx), abs(cy)));
    const F depth = max_x86(max_x86(abs(az), abs(bz)), abs(cz));
    const F error = madd(F(kBound), madd(F(7.0f * 0x1p-24f), depth, width) * (depth + width), F(kLeast));
    return {az, bz, cz, u, v, w, min_x86(min_x86(u, v), w), max_x86(max_x86(u, v), w), error};
  }

  template <int W>
  static ARBORETUM_INLINE void find_distances(const RayData& ray, const Edges<W>& l, float tnear, float tfar,
                                              Distances<W>& d) {
    using F = vf<W>;
    const F sz(ray.in_memory().shear[2]), za = sz * l.az, zb = sz * l.bz, zc = sz * l.cz;
    const F nearest = min_x86(min_x86(za, zb), zc), farthest = max_x86(max_x86(za, zb), zc);
    const F size = max_x86(abs(nearest), abs(farthest));
    const F det = l.u + l.v + l.w, inverse = F(1.0f) / det;
    const F t = madd(l.u * inverse, za, madd(l.v * inverse, zb, (l.w * inverse) * zc));
    const F spread =
        madd(F(3.0f) * l.error * abs(inverse), farthest - nearest, madd(F(20.0f * 0x1p-24f), size, F(kLeast)));
    // Beyond 2^126 the reciprocal loses bits, or all.
    const vm<W> certain =
        l.certainly_hit() & (abs(det) < F(0x1p126f)) & (abs(t) + spread < F(std::numeric_limits<float>::infinity()));
    const F pad = madd(F(8.0f * 0x1p-24f), size, F(kLeast));
    const F low = select(certain, t - spread, nearest - pad), high = select(certain, t + spread, farthest + pad);
    low.store(d.low), high.store(d.high);
    d.certain = certain.bits();
    // Comparisons that a NaN makes false: a lane without a usable interval stays.
    d.candidates = l.candidates() & ~((low > F(tfar)) | (high < F(tnear))).bits();
  }

  /// The candidate, as a bit, that is certainly hit behind tnear, with a narrow interval before those of all other
  /// candidates; else 0.
  template <int W>
  static ARBORETUM_INLINE unsigned foremost(const Distances<W>& d, float tnear) {
    using F = vf<W>;
    const unsigned certain = d.candidates & d.certain;
    if (__builtin_expect((d.candidates & (d.candidates - 1)) == 0, 1)) {
      if (certain == 0) return 0;
      const int i = __builtin_ctz(certain);
      return d.low[i] >= tnear && d.high[i] - d.low[i] <= kWide * __builtin_fabsf(d.high[i]) ? certain : 0;
    }
    const F low = F::load(d.low), high = F::load(d.high);
    const vm<W> narrow = vm<W>::from_bits(certain) & (low >= F(tnear)) & (high - low <= F(kWide) * abs(high));
    const float least = reduce_min(select(narrow, high, F(std::numeric_limits<float>::infinity())));
    // One without an interval (NaN) may be anywhere.
    const unsigned first = d.candidates & ~(low > F(least)).bits();
    return (first & (first - 1)) == 0 ? first & narrow.bits() : 0;
  }

  template <class Block>
  static ARBORETUM_INLINE std::array<Vec3f, 3> corners(const Block& block, int i) {
    return {Vec3f{block.v0[0][i], block.v0[1][i], block.v0[2][i]},
            Vec3f{block.v1[0][i], block.v1[1][i], block.v1[2][i]},
            Vec3f{block.v2[0][i], block.v2[1][i], block.v2[2][i]}};
  }

  template <class Block>
  static __attribute__((noinline)) bool nearest(RayData& ray, const Block& block, const Distances<Block::kWidth>& d,
                                                float tnear, NearestHit& best) {
    bool changed = false;
    for (unsigned rest = d.candidates; rest; rest &= rest - 1) {
      const int i = __builtin_ctz(rest);
      changed |= offer(ray, corners(block, i), std::int32_t(block.id[i]), (d.certain >> i & 1u) != 0,
                       {d.low[i], d.high[i]}, tnear, best);
    }
    return changed;
  }

  /// Takes a lane for the best hit if it is: it may be hit, at a t within `t`.
  static __attribute__((noinline)) bool offer(RayData& ray, const std::array<Vec3f, 3>& corner, std::int32_t id,
                                              bool certain, DistanceInterval t, float tnear, NearestHit& best) {
    if (ray.has_best && (t.low > best.t || id == best.primitive)) return false;
    // Nothing beyond the best hit is asked for, but its t is not known exactly: that is compared below.
    const Ray exact{ray.origin, tnear, ray.towards, ray.has_best ? std::numeric_limits<float>::infinity() : best.t};
    if (!certain || t.low < tnear || t.high > exact.tfar) {
      if (!meets_exactly(exact, corner, t)) return false;
    } else if (t.high - t.low > kWide * __builtin_fabsf(t.high)) {
      const DistanceInterval closer = distance_in_double(exact, corner);
      if (closer.low > t.low) t.low = closer.low;
      if (closer.high < t.high) t.high = closer.high;
    }
    if (ray.has_best && t.high >= ray.best_low) {
      if (t.low > best.t) return false;
      const int order = compare_distances_exactly(exact, corner, ray.best.corners());
      if (order > 0 || (order == 0 && id > best.primitive)) return false;
    }
    ray.has_best = true, ray.best = CornersInFours(corner), ray.best_low = t.low;
    if (t.high < best.t) best.t = t.high;  // else the old bound, which holds for what is nearer still
    best.primitive = id;
    return true;
  }

  template <class Block>
  static __attribute__((noinline)) bool any_within(const RayData& ray, const Block& block,
                                                   const Distances<Block::kWidth>& d, float tnear, float tfar) {
    for (unsigned rest = d.candidates & d.certain; rest; rest &= rest - 1) {
      const int i = __builtin_ctz(rest);
      if (d.low[i] >= tnear && d.high[i] <= tfar) return true;
    }
    for (unsigned rest = d.candidates; rest; rest &= rest - 1) {
      DistanceInterval t;
      if (meets_exactly({ray.origin, tnear, ray.towards, tfar}, corners(block, __builtin_ctz(rest)), t)) return true;
    }
    return false;
  }

  /// Width of an interval, relative to t, above which doubles narrow it: a wide one lets boxes through that lie behind
  /// the hit.
  static constexpr float kWide = 0x1p-14f;
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
