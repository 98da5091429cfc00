// Exact: hit or miss, the nearest primitive (of equal distances the lowest id) and the rounded t are those of rational
// arithmetic on the float32 inputs. A float filter with a proved bound decides nearly all lanes; exact arithmetic
// (core/exact/hit_arithmetic.h) decides the others. The idea of a filter is Shewchuk's (Adaptive Precision, 1997); its
// form is the sheared one of Woop, Benthin and Wald (JCGT 2(1) 2013), as in watertight.h.
//
// The bound. u = 2^-24; p = (x, y, z) a vertex as seen from the origin (or its opposite, which has the same errors),
// permuted so that |d_z| is the largest; S = d_x / d_z, so |S| <= 1; x' = x - S z (y' likewise) the exact sheared
// vertex, x^ the computed one; Z, L the largest |z^| and |x^|, |y^| of a triangle. z^ and the difference x are off by u
// of themselves, S by u / 2; |x| <= |x'| + |z|. So the shear is off by
//   u (L + Z) + u Z + u Z / 2 + u L = u (2 L + 2.5 Z) < delta,
//   delta = u (2 L + 3 Z) fused, u (2 L + 4 Z) where the product is rounded.
// (What underflow adds, 2^-150, is less than the slack u (L + Z / 2), or so small that the last term of E holds it.)
//
// An edge function U = x^_c y^_b - y^_c x^_b is then off by
//   4 L delta + 2 delta^2, and by its own roundings, 3 u L^2 fused and 4 u L^2 not: by less than
//   u (12 L Z + 11 L^2) + 18 u^2 Z^2 + higher terms fused, u (14 L Z + 12 L^2) + 25 u^2 Z^2 not; hence
//   E = k u (L + 7 u Z) (L + Z) + 2^-140,  k = 12.5 fused, 14.5 not.
// At least 3.5 % are left for E's own five roundings, and 2^-140 is more than all underflows. U, V, W all beyond E on
// one side: certainly hit; one beyond E, another beyond -E: certainly missed; else exact arithmetic. An overflow of z^,
// x^, y^ or of a product makes E infinite or NaN, since (L + 7 u Z) (L + Z) is no less than any product, and then
// nothing is certain. (A NaN x^ comes of an infinite z^ or of a NaN shear alone, so max_abs may drop it.) Denormals
// must not be flushed.
//
// Distances. With z in units of t (times 1 / d_z), t is the mean of the vertices' z with weights U / (U + V + W) >= 0.
// The weights' errors move it by less than
//   (E / |U + V + W|) (|z_a - t| + |z_b - t| + |z_c - t|) <= 2 (E / |U + V + W|) (z_max - z_min);
// the roundings of weights, z and their sum by 4, 3 and 3 u max |z|, those of z_max - z_min by 4 u max |z| more, as
// E < |U + V + W| / 3. The interval about t is padded by
//   3 E / |U + V + W| (z_max - z_min) + 20 u max |z| + 2^-140.
// A hit that the filter has not decided lies within [z_min, z_max], padded by 8 u max |z|. Where these intervals leave
// open which hit counts, doubles narrow them (DoubleDistances), for all triangles of a block at once.
//
// The nearest. A hit is left out only when its interval lies beyond that of the best; where they overlap the exact
// distances are compared. best.t is the high end of the best hit's interval until finish(), so that no box in front of
// the exact t is culled. Nearly always the nearest candidate of a block is certainly hit, and its interval lies before
// all others: it is taken where the filter stands.
#pragma once

#include <cstddef>
#include <cstring>

#include "core/exact/hit_arithmetic.h"
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

  /// What W rays of a packet make of one triangle: it is within what counts for the `hit` ones, at a t within their
  /// [low, high]; the filter cannot say for those of `again`, which have to be tested alone.
  template <int W>
  struct FilteredRays {
    unsigned hit, again;
    vf<W> low, high;
  };
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
    const unsigned within = met & possible(t.low, t.high, tnear, tfar);
    out.low = t.low, out.high = t.high;
    out.hit = within & settled<AnyHit>(t.low, t.high, t.certain, tnear, tfar), out.again = within & ~out.hit;
    if (__builtin_expect(out.again != 0, 0)) {
      FilteredRays<W> narrowed = out;  // a reference to `out` would keep it in memory
      narrow_rays<AnyHit>(rays, k, block, i, t.certain.bits(), tnear, tfar, narrowed);
      out = narrowed;
    }
  }
  /// The nearest hits of a packet's rays (traversal/packet_leaves.h): of the interval of each the low end, the high one
  /// being the packet's t, and its triangle, whose block stays where it is.
  template <class Block>
  class PacketHits {
   public:
    template <int W>
    ARBORETUM_INLINE void start(int k, vf<W> tfar) {
      tfar.store(low_ + k);
    }
    /// Of the rays that triangle i of a block certainly hits no farther than their t, `found.hit`, those for which it
    /// is certainly the nearest so far; sets their t.
    template <int W>
    ARBORETUM_INLINE unsigned take(int k, const FilteredRays<W>& found, const Block& block, int i, float* t) {
      using F = vf<W>;
      const F low = F::load(low_ + k);
      const vm<W> nearer = vm<W>::from_bits(found.hit) & (found.high < low);
      select(nearer, found.low, low).store(low_ + k), select(nearer, found.high, F::load(t + k)).store(t + k);
      const auto address = reinterpret_cast<std::uintptr_t>(&block.v0[0][i]);
      const auto put = [nearer](std::uint32_t* to, std::uint32_t half) {
        select(nearer, vi<W>(std::int32_t(half)), vi<W>::load(to)).store(to);
      };
      put(first_[0] + k, std::uint32_t(address)), put(first_[1] + k, std::uint32_t(std::uint64_t(address) >> 32));
      return nearer.bits();
    }
    [[nodiscard]] ARBORETUM_INLINE NearestHit at(int i, float t) const {
      std::int32_t id;
      std::memcpy(&id, first(i) + (offsetof(Block, id) - offsetof(Block, v0)) / sizeof(float), sizeof id);
      return {t, 0.0f, 0.0f, id};
    }
    [[nodiscard]] ARBORETUM_INLINE CornersInFours corners(int i) const {
      return CornersInFours::of_rows([p = first(i)](int row) { return p[row * Block::kWidth]; });
    }
    /// What ray i has met so far, for its search to go on alone; and what it has met there, once it is back.
    ARBORETUM_INLINE void bring(int i, RayData& ray) const {
      ray.has_best = true, ray.best = corners(i), ray.best_low = low_[i];
    }
    ARBORETUM_INLINE void take_back(int i, const RayData& ray) { low_[i] = ray.best_low; }

   private:
    static_assert(offsetof(Block, v1) == offsetof(Block, v0) + 3 * sizeof(float[Block::kWidth]) &&
                  offsetof(Block, v2) == offsetof(Block, v1) + 3 * sizeof(float[Block::kWidth]) &&
                  sizeof Block::id == sizeof(float[Block::kWidth]));
    /// The first coordinate of ray i's triangle; the others follow, a row of the block apart.
    [[nodiscard]] ARBORETUM_INLINE const float* first(int i) const {
      return reinterpret_cast<const float*>(std::uintptr_t(first_[0][i] | std::uint64_t(first_[1][i]) << 32));
    }

    alignas(64) float low_[PacketRays::kMost];
    alignas(64) std::uint32_t first_[2][PacketRays::kMost];  ///< the halves of its address
  };

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
  /// Width of an interval, relative to t, above which doubles narrow it: a wide one lets boxes through that lie behind
  /// the hit.
  static constexpr float kWide = 0x1p-14f;
  /// Beyond these 1 / d_z is not within u of itself.
  static constexpr float kLeastDirection = 0x1p-120f, kMostDirection = 0x1p120f;

  /// A block after the filter: sheared depths, edge functions, the least and the greatest of these, their bound.
  template <int W>
  struct Edges {
    using F = vf<W>;
    F az, bz, cz, u, v, w, lowest, highest, error;

    ARBORETUM_INLINE explicit Edges(const ShearedVertices<W>& p) : az(p.a.z), bz(p.b.z), cz(p.c.z) {
      const auto [ax, ay, a] = p.a;
      const auto [bx, by, b] = p.b;
      const auto [cx, cy, c] = p.c;
      u = msub(cx, by, cy * bx), v = msub(ax, cy, ay * cx), w = msub(bx, ay, by * ax);
      const F width = max_abs(max_abs(max_abs(ax, ay), max_abs(bx, by)), max_abs(cx, cy));
      const F depth = largest_component(az, bz, cz);
      error = madd(F(kBound), madd(F(7.0f * 0x1p-24f), depth, width) * (depth + width), F(kLeast));
      lowest = min_x86(min_x86(u, v), w), highest = max_x86(max_x86(u, v), w);
    }

    /// Lanes that are not certainly missed. An error that is not finite misses nothing; an empty lane's depth is NaN,
    /// that of a triangle never.
    ARBORETUM_INLINE unsigned candidates() const {
      return (az == az).bits() & ~(min_x86(highest, -lowest) > error).bits();
    }
    ARBORETUM_INLINE vm<W> certainly_hit() const { return max_x86(lowest, -highest) > error; }
  };

  /// t of a lane is within [low, high] if it is hit; the `certain` ones are.
  template <int W>
  struct Intervals {
    using F = vf<W>;
    vm<W> certain;
    F low, high;

    /// `sz`: -1 / d_z.
    ARBORETUM_INLINE Intervals(const Edges<W>& l, F sz) {
      const F za = sz * l.az, zb = sz * l.bz, zc = sz * l.cz;
      const F nearest = min_x86(min_x86(za, zb), zc), farthest = max_x86(max_x86(za, zb), zc);
      const F size = max_abs(nearest, farthest);
      const F det = l.u + l.v + l.w, inverse = F(1.0f) / det;
      const F t = madd(l.u * inverse, za, madd(l.v * inverse, zb, (l.w * inverse) * zc));
      const F spread =
          madd(F(3.0f) * l.error * abs(inverse), farthest - nearest, madd(F(20.0f * 0x1p-24f), size, F(kLeast)));
      // Beyond 2^126 the reciprocal loses bits, or all.
      certain =
          l.certainly_hit() & (abs(det) < F(0x1p126f)) & (abs(t) + spread < F(std::numeric_limits<float>::infinity()));
      const F pad = madd(F(8.0f * 0x1p-24f), size, F(kLeast));
      low = select(certain, t - spread, nearest - pad), high = select(certain, t + spread, farthest + pad);
    }
  };

  /// Lanes whose t may be within [tnear, tfar]. Comparisons that a NaN makes false: one without a usable interval may.
  template <int W>
  static ARBORETUM_INLINE unsigned possible(vf<W> low, vf<W> high, vf<W> tnear, vf<W> tfar) {
    return ~((low > tfar) | (high < tnear)).bits();
  }
  /// Lanes whose t is, and, where the nearest is looked for, known well: no box that begins behind it is let through by
  /// much.
  template <bool AnyHit, int W>
  static ARBORETUM_INLINE unsigned settled(vf<W> low, vf<W> high, vm<W> certain, vf<W> tnear, vf<W> tfar) {
    vm<W> all = certain & (low >= tnear) & (high <= tfar);
    if constexpr (!AnyHit) all = all & (high - low <= vf<W>(kWide) * abs(high));
    return all.bits();
  }

  /// The candidates within an interval: t of lane i is within [low[i], high[i]] if it is hit; the `certain` lanes are.
  template <int W>
  struct Distances {
    unsigned candidates, certain;
    alignas(64) float low[W], high[W];
  };

  /// t of the planes of D triangles in doubles; `usable` lanes have a bound. That is of the products that t is made of,
  /// so that it is next to nothing for a ray that starts next to a wall along the axes, and nothing on one.
  template <int D>
  struct DoubleDistances {
    using F = vd<D>;
    F low, high;
    unsigned usable;

    /// `a`: the first corner as seen from the origin; e1, e2: edges from it.
    ARBORETUM_INLINE DoubleDistances(const vd3<D>& towards, const vd3<D>& a, const vd3<D>& e1, const vd3<D>& e2) {
      const auto dot = [](const vd3<D>& p, const vd3<D>& q) { return p.x * q.x + p.y * q.y + p.z * q.z; };
      const auto magnitudes = [](const vd3<D>& p) { return vd3<D>{abs(p.x), abs(p.y), abs(p.z)}; };
      const vd3<D> p{e1.y * e2.z, e1.z * e2.x, e1.x * e2.y}, q{e1.z * e2.y, e1.x * e2.z, e1.y * e2.x};
      const vd3<D> n = p - q, terms = magnitudes(p) + magnitudes(q);
      const F inverse = F(1.0) / dot(n, towards), t = dot(n, a) * inverse;
      const F scale = abs(F(double_bounds::kTripleProducts * double_bounds::kQuotient) * inverse);
      const F along_error = scale * dot(terms, magnitudes(towards)),
              radius = scale * dot(terms, magnitudes(a)) + abs(t) * (along_error + F(double_bounds::kRounding));
      low = t - radius, high = t + radius;
      usable = along_error < F(double_bounds::kMostOfDivisor);
    }
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
    d.candidates = l.candidates() & possible(t.low, t.high, F(tnear), F(tfar));
  }

  /// Intervals about t of `lanes`, in doubles: an ulp or two of float wide where a triangle is not seen edge on.
  template <int W>
  struct NarrowIntervals {
    static constexpr int D = kDoubleLanes<W>;
    vd<D> low[W / D], high[W / D];
    unsigned usable = 0;

    /// `distances(k)`: the DoubleDistances of the D lanes from k on.
    template <class Distances>
    ARBORETUM_INLINE NarrowIntervals(unsigned lanes, const Distances& distances) {
      for (int k = 0; k < W / D; ++k) {
        low[k] = high[k] = 0.0;
        if ((lanes >> k * D & ((1u << D) - 1u)) == 0) continue;
        const DoubleDistances<D> t = distances(k * D);
        low[k] = t.low, high[k] = t.high;
        usable |= t.usable << k * D;
      }
    }
    /// Of these intervals and those given what both hold.
    ARBORETUM_INLINE void narrow(vf<W>& l, vf<W>& h) const {
      using F = vf<W>;
      // Rounding to floats takes at most half of this from either end.
      const auto ulp = [](F x) { return madd(abs(x), F(0x1p-23f), F(0x1p-149f)); };
      const vm<W> narrowed = vm<W>::from_bits(usable);
      const F new_low = to_floats<W>(low), new_high = to_floats<W>(high);
      l = select(narrowed, max_x86(new_low - ulp(new_low), l), l);
      h = select(narrowed, min_x86(new_high + ulp(new_high), h), h);
    }
  };

  template <int D>
  static ARBORETUM_INLINE vd3<D> in_doubles(const Vec3f& p) {
    return {vd<D>(double(p.x)), vd<D>(double(p.y)), vd<D>(double(p.z))};
  }

  /// The distances of all candidates again, in doubles. What is left are the candidates that may be within [tnear,
  /// tfar].
  template <class Block>
  static ARBORETUM_INLINE void narrow(const RayData& ray, const Block& block, float tnear, float tfar,
                                      Distances<Block::kWidth>& d) {
    constexpr int W = Block::kWidth, D = kDoubleLanes<W>;
    using F = vf<W>;
    const vd3<D> o = in_doubles<D>(ray.origin), towards = in_doubles<D>(ray.towards);
    const NarrowIntervals<W> t(d.candidates, [&](int k) {
      const auto corner = [k](const float(&p)[3][W]) { return load3<D>(p[0] + k, p[1] + k, p[2] + k); };
      const vd3<D> a = corner(block.v0);
      return DoubleDistances<D>(towards, a - o, corner(block.v1) - a, corner(block.v2) - a);
    });
    F low = F::load(d.low), high = F::load(d.high);
    t.narrow(low, high);
    low.store(d.low), high.store(d.high);
    d.candidates &= possible(low, high, F(tnear), F(tfar));
  }

  /// The same for the rays of `out.again`, W from k on, and triangle `i` of the block.
  template <bool AnyHit, int W, class Block>
  static __attribute__((noinline)) void narrow_rays(const PacketRays& rays, int k, const Block& block, int i,
                                                    unsigned certain, vf<W> tnear, vf<W> tfar, FilteredRays<W>& out) {
    constexpr int D = kDoubleLanes<W>;
    using F = vf<W>;
    const std::array<Vec3f, 3> corner = corners(block, i);
    const vd3<D> a = in_doubles<D>(corner[0]), e1 = in_doubles<D>(corner[1]) - a, e2 = in_doubles<D>(corner[2]) - a;
    const NarrowIntervals<W> t(out.again, [&](int at) {
      const auto of_rays = [first = k + at](const float(&p)[3][PacketRays::kMost]) {
        return load3<D>(p[0] + first, p[1] + first, p[2] + first);
      };
      return DoubleDistances<D>(of_rays(rays.direction), a - of_rays(rays.origin), e1, e2);
    });
    F low = out.low, high = out.high;
    t.narrow(low, high);
    out.low = low, out.high = high;
    const unsigned within = out.again & possible(low, high, tnear, tfar),
                   hit = within & settled<AnyHit>(low, high, vm<W>::from_bits(certain), tnear, tfar);
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
      return d.low[i] >= tnear && d.high[i] - d.low[i] <= kWide * __builtin_fabsf(d.high[i]) ? certain : 0;
    }
    const F low = F::load(d.low), high = F::load(d.high);
    const vm<W> narrow = vm<W>::from_bits(certain) & (low >= F(tnear)) & (high - low <= F(kWide) * abs(high));
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
