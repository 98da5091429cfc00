// Exact: hit or miss, the nearest primitive (of equal distances the lowest id) and the rounded t are those of rational
// arithmetic on the float32 inputs. A float filter with a proved bound decides nearly all lanes; exact arithmetic
// (core/exact/hit_arithmetic.h) decides the others. The idea of a filter is Shewchuk's (Adaptive Precision, 1997); its
// form is the sheared one of Woop, Benthin and Wald (JCGT 2(1) 2013), as in watertight.h.
//
// The bound on the filter's errors, and that on t, are proved in exact_filter.h.
//
// The nearest. A hit is left out only when its interval lies beyond that of the best; where they overlap the exact
// distances are compared. best.t is the high end of the best hit's interval until finish(), so that no box in front of
// the exact t is culled. Nearly always the nearest candidate of a block is certainly hit, and its interval lies before
// all others: it is taken where the filter stands.
#pragma once

#include "core/exact/hit_arithmetic.h"
#include "intersectors/exact_distances.h"
#include "intersectors/exact_filter.h"
#include "intersectors/exact_packet.h"
#include "intersectors/leaf_block.h"
#include "intersectors/round_later.h"
#include "intersectors/sheared_packet.h"

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
      if (__builtin_expect(!(largest >= kLeastDirection && largest <= kMostDirection), 0))
        shear[0] = shear[2] = std::numeric_limits<float>::quiet_NaN();
    }
    /// With shear constants known.
    ARBORETUM_INLINE RayData(const Ray& ray, unsigned axis, float shear_x, float shear_y, float shear_z)
        : ShearedRay(ray, axis, shear_x, shear_y, shear_z), origin(ray.origin), towards(ray.direction),
          best_low(ray.tfar) {}
  };

  struct PacketData : ShearedPacket {
    template <int W>
    ARBORETUM_INLINE void prepare(const PacketRays& rays, int k) {
      ShearedPacket::prepare<W>(rays, k);
      // As in RayData: 1 / |d_z| for |d_z|, the bounds being each other's reciprocals.
      using F = vf<W>;
      const F inverse = abs(F::load(sz + k));
      const vm<W> usable = (inverse >= F(kLeastDirection)) & (inverse <= F(kMostDirection));
      if (__builtin_expect(!all(usable), 0)) {
        const F nan(std::numeric_limits<float>::quiet_NaN());
        select(usable, F::load(sx + k), nan).store(sx + k), select(usable, F::load(sz + k), nan).store(sz + k);
      }
    }
    [[nodiscard]] ARBORETUM_INLINE RayData alone(const Ray& ray, int i) const {
      return RayData(ray, axis(i), sx[i], sy[i], sz[i]);
    }
  };

#if ARBORETUM_TARGET != ARBORETUM_TARGET_SCALAR
  template <class H>
  using Unfinished = UnroundedHits<H>;
#endif

  /// True when `best` has changed.
  template <class Block>
  static ARBORETUM_INLINE bool closest_hit_block(RayData& ray, const Block& block, float tnear, NearestHit& best) {
    const Edges<Block::kWidth> edges = filter(ray, block);
    if (__builtin_expect(edges.candidates() == 0, 1)) return false;
    Distances<Block::kWidth> d;
    find_distances(ray, edges, tnear, best.t, d);
    if (d.candidates == 0) return false;
    if (__builtin_expect(take_foremost(ray, block, d, tnear, best), 1)) return true;
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

#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
  template <class Block>
  using ForTwoRays = const Block&;
  /// What closest_hit_block() or any_hit_block() do, for two rays.
  template <bool AnyHit, class Block>
  static ARBORETUM_INLINE unsigned test_two(RayData& low, RayData& high, const Block& block, const Ray& low_ray,
                                            const Ray& high_ray, NearestHit& low_best, NearestHit& high_best) {
    const Edges<16> edges(ShearedVertices<16>(low, high, block));
    const unsigned met = edges.candidates();
    if (__builtin_expect(met == 0, 1)) return 0;
    const Intervals<16> t(edges, in_halves(low.shear[2], high.shear[2]));
    const vf<16> tnear = in_halves(low_ray.tnear, high_ray.tnear),
                 tfar = AnyHit ? in_halves(low_ray.tfar, high_ray.tfar) : in_halves(low_best.t, high_best.t);
    const unsigned within = met & exact_filter::possible(t.low, t.high, tnear, tfar), certain = t.certain.bits();
    if (within == 0) return 0;
    const auto one = [&block](RayData& ray, unsigned candidates, unsigned its_certain, vf<8> least, vf<8> most,
                              const Ray& r, NearestHit& best) {
      if (candidates == 0) return false;
      Distances<8> d{candidates, its_certain, {}, {}};
      least.store(d.low), most.store(d.high);
      if constexpr (AnyHit) {
        return any_within(ray, block, d, r.tnear, r.tfar);
      } else {
        return __builtin_expect(take_foremost(ray, block, d, r.tnear, best), 1) ||
               nearest(ray, block, d, r.tnear, best);
      }
    };
    const bool first =
        one(low, within & 0xffu, certain & 0xffu, lower_half(t.low), lower_half(t.high), low_ray, low_best);
    const bool second =
        one(high, within >> 8, certain >> 8, upper_half(t.low), upper_half(t.high), high_ray, high_best);
    return unsigned(first) | unsigned(second) << 1;
  }
#endif

  template <int W>
  using FilteredRays = exact_filter::FilteredRays<W>;
  template <class Block>
  using PacketHits = exact_filter::PacketHits<Block>;

  /// Lanes are the W rays from k on, of group kz, all against triangle `i` of the block; only those of `in` count.
  template <bool AnyHit, int W, class Block>
  static ARBORETUM_INLINE void filter_rays(const PacketRays& rays, const PacketData& packet, int kz, int k, unsigned in,
                                           const Block& block, int i, vf<W> tfar, FilteredRays<W>& out) {
    using F = vf<W>;
    const Edges<W> edges(packet.template sheared<W>(rays, kz, k, block, i));
    out.hit = out.again = 0;
    const unsigned met = in & edges.candidates();
    if (met == 0) return;
    const Intervals<W> t(edges, F::load(packet.sz + k));
    const F tnear = F::load(rays.tnear + k);
    const unsigned within = met & exact_filter::possible(t.low, t.high, tnear, tfar);
    out.low = t.low, out.high = t.high;
    out.hit = within & exact_filter::settled<AnyHit>(t.low, t.high, t.certain, tnear, tfar),
    out.again = within & ~out.hit;
    if (__builtin_expect(out.again != 0, 0)) {
      FilteredRays<W> narrowed = out;  // a reference to `out` would keep it in memory
      narrow_rays<AnyHit>(rays, k, block, i, t.certain.bits(), tnear, tfar, narrowed);
      out = narrowed;
    }
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
  template <int W>
  using Edges = exact_filter::Edges<W>;
  template <int W>
  using Intervals = exact_filter::Intervals<W>;

  /// Beyond these 1 / d_z is not within u of itself.
  static constexpr float kLeastDirection = 0x1p-120f, kMostDirection = 0x1p120f;

  /// The candidates within an interval: t of lane i is within [low[i], high[i]] if it is hit; the `certain` lanes are.
  template <int W>
  struct Distances {
    unsigned candidates, certain;
    alignas(64) float low[W], high[W];
  };

  template <class Block>
  static ARBORETUM_INLINE Edges<Block::kWidth> filter(const RayData& ray, const Block& block) {
    return Edges<Block::kWidth>(ShearedVertices<Block::kWidth>(ray.in_memory(), block));
  }

  template <int W>
  static ARBORETUM_INLINE void find_distances(const RayData& ray, const Edges<W>& l, float tnear, float tfar,
                                              Distances<W>& d) {
    using F = vf<W>;
    const Intervals<W> t(l, F(ray.in_memory().shear[2]));
    t.low.store(d.low), t.high.store(d.high);
    d.certain = t.certain.bits();
    d.candidates = l.candidates() & exact_filter::possible(t.low, t.high, F(tnear), F(tfar));
  }

  /// The distances of all candidates again, in doubles. What is left are the candidates that may be within [tnear,
  /// tfar].
  template <class Block>
  static ARBORETUM_INLINE void narrow(const RayData& ray, const Block& block, float tnear, float tfar,
                                      Distances<Block::kWidth>& d) {
    constexpr int W = Block::kWidth, D = kDoubleLanes<W>;
    using F = vf<W>;
    const vd3<D> o = exact_filter::in_doubles<D>(ray.origin), towards = exact_filter::in_doubles<D>(ray.towards);
    const exact_filter::NarrowIntervals<W> t(d.candidates, [&](int k) {
      const auto corner = [k](const float(&p)[3][W]) { return load3<D>(p[0] + k, p[1] + k, p[2] + k); };
      const vd3<D> a = corner(block.v0);
      return exact_filter::DoubleDistances<D>(towards, a - o, corner(block.v1) - a, corner(block.v2) - a);
    });
    F low = F::load(d.low), high = F::load(d.high);
    t.narrow(low, high);
    low.store(d.low), high.store(d.high);
    d.candidates &= exact_filter::possible(low, high, F(tnear), F(tfar));
  }

  /// The same for the rays of `out.again`, W from k on, and triangle `i` of the block.
  template <bool AnyHit, int W, class Block>
  static __attribute__((noinline)) void narrow_rays(const PacketRays& rays, int k, const Block& block, int i,
                                                    unsigned certain, vf<W> tnear, vf<W> tfar, FilteredRays<W>& out) {
    constexpr int D = kDoubleLanes<W>;
    using F = vf<W>;
    const std::array<Vec3f, 3> corner = corners(block, i);
    const vd3<D> a = exact_filter::in_doubles<D>(corner[0]), e1 = exact_filter::in_doubles<D>(corner[1]) - a,
                 e2 = exact_filter::in_doubles<D>(corner[2]) - a;
    const exact_filter::NarrowIntervals<W> t(out.again, [&](int at) {
      const auto of_rays = [first = k + at](const float(&p)[3][PacketRays::kMost]) {
        return load3<D>(p[0] + first, p[1] + first, p[2] + first);
      };
      return exact_filter::DoubleDistances<D>(of_rays(rays.direction), a - of_rays(rays.origin), e1, e2);
    });
    F low = out.low, high = out.high;
    t.narrow(low, high);
    out.low = low, out.high = high;
    const unsigned within = out.again & exact_filter::possible(low, high, tnear, tfar),
                   hit = within & exact_filter::settled<AnyHit>(low, high, vm<W>::from_bits(certain), tnear, tfar);
    out.hit |= hit, out.again = within & ~hit;
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
      return d.low[i] >= tnear && (d.high[i] - d.low[i]) * exact_filter::kNarrow <= __builtin_fabsf(d.high[i]) ? certain
                                                                                                               : 0;
    }
    const F low = F::load(d.low), high = F::load(d.high);
    const vm<W> narrow =
        vm<W>::from_bits(certain) & (low >= F(tnear)) & ((high - low) * F(exact_filter::kNarrow) <= abs(high));
    const float least = reduce_min(select(narrow, high, F(std::numeric_limits<float>::infinity())));
    // One without an interval (NaN) may be anywhere.
    const unsigned first = d.candidates & ~(low > F(least)).bits();
    return (first & (first - 1)) == 0 ? first & narrow.bits() : 0;
  }

  /// True when it has become the best hit.
  template <class Block>
  static ARBORETUM_INLINE bool take_foremost(RayData& ray, const Block& block, const Distances<Block::kWidth>& d,
                                             float tnear, NearestHit& best) {
    const unsigned lane = foremost(d, tnear);
    if (__builtin_expect(lane == 0, 0)) return false;
    const int i = __builtin_ctz(lane);
    const float high = d.high[i];
    if (__builtin_expect(!(high < ray.best_low && high <= best.t), 0)) return false;
    ray.has_best = true, ray.best = CornersInFours(block, i), ray.best_low = d.low[i];
    best.t = high, best.primitive = std::int32_t(block.id[i]);
    return true;
  }

  template <class Block>
  static ARBORETUM_INLINE std::array<Vec3f, 3> corners(const Block& block, int i) {
    return {Vec3f{block.v0[0][i], block.v0[1][i], block.v0[2][i]},
            Vec3f{block.v1[0][i], block.v1[1][i], block.v1[2][i]},
            Vec3f{block.v2[0][i], block.v2[1][i], block.v2[2][i]}};
  }

  template <class Block>
  static __attribute__((noinline)) bool nearest(RayData& ray, const Block& block, Distances<Block::kWidth>& d,
                                                float tnear, NearestHit& best) {
    narrow(ray, block, tnear, best.t, d);
    if (d.candidates == 0) return false;
    if (take_foremost(ray, block, d, tnear, best)) return true;
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

  template <int W>
  static ARBORETUM_INLINE bool certainly_within(const Distances<W>& d, float tnear, float tfar) {
    for (unsigned rest = d.candidates & d.certain; rest; rest &= rest - 1) {
      const int i = __builtin_ctz(rest);
      if (d.low[i] >= tnear && d.high[i] <= tfar) return true;
    }
    return false;
  }

  template <class Block>
  static __attribute__((noinline)) bool any_within(const RayData& ray, const Block& block, Distances<Block::kWidth>& d,
                                                   float tnear, float tfar) {
    if (certainly_within(d, tnear, tfar)) return true;
    narrow(ray, block, tnear, tfar, d);
    if (d.candidates == 0) return false;
    if (certainly_within(d, tnear, tfar)) return true;
    for (unsigned rest = d.candidates; rest; rest &= rest - 1) {
      DistanceInterval t;
      if (meets_exactly({ray.origin, tnear, ray.towards, tfar}, corners(block, __builtin_ctz(rest)), t)) return true;
    }
    return false;
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
