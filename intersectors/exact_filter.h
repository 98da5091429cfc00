// The filter of `exact` (exact.h): sheared edge functions and distances in float, with proved bounds on their errors.
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
//   E = k u (L + 7 u Z) (L + Z) + 2^-126,  k = 12.5 fused, 14.5 not.
// At least 3.5 % are left for E's own five roundings, and 2^-126 is more than all underflows (2^-140 would do; but
// where it is added in a fused operation, a subnormal number takes Intel's cores some 150 cycles). U, V, W all beyond E
// on one side: certainly hit; one beyond E, another beyond -E: certainly missed; else exact arithmetic. An overflow of
// z^, x^, y^ or of a product makes E infinite or NaN, since (L + 7 u Z) (L + Z) is no less than any product, and then
// nothing is certain. (A NaN x^ comes of an infinite z^ or of a NaN shear alone, so max_abs may drop it.) Denormals
// must not be flushed.
//
// Distances. With z in units of t (times 1 / d_z), t is the mean of the vertices' z with weights U / (U + V + W) >= 0.
// The weights' errors move it by less than
//   (E / |U + V + W|) (|z_a - t| + |z_b - t| + |z_c - t|) <= 2 (E / |U + V + W|) (z_max - z_min);
// the roundings of weights, z and their sum by 4, 3 and 3 u max |z|, those of z_max - z_min by 4 u max |z| more, as
// E < |U + V + W| / 3. The interval about t is padded by
//   3 E / |U + V + W| (z_max - z_min) + 20 u max |z| + 2^-126.
// A hit that the filter has not decided lies within [z_min, z_max], padded by 8 u max |z|. Where these intervals leave
// open which hit counts, doubles narrow them (DoubleDistances), for all triangles of a block at once.
#pragma once

#include <limits>

#include "intersectors/sheared_packet.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {
namespace exact_filter {

inline constexpr float kBound = (kHasFma ? 12.5f : 14.5f) * 0x1p-24f;
inline constexpr float kLeast = std::numeric_limits<float>::min();  ///< 2^-126, the least that is not subnormal
/// Doubles narrow an interval that is wider than t / kNarrow: a wide one lets boxes through that lie behind the hit.
inline constexpr float kNarrow = 0x1p14f;

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
[[nodiscard]] ARBORETUM_INLINE unsigned possible(vf<W> low, vf<W> high, vf<W> tnear, vf<W> tfar) {
  return ~((low > tfar) | (high < tnear)).bits();
}
/// Lanes whose t is, and, where the nearest is looked for, known well: no box that begins behind it is let through by
/// much.
template <bool AnyHit, int W>
[[nodiscard]] ARBORETUM_INLINE unsigned settled(vf<W> low, vf<W> high, vm<W> certain, vf<W> tnear, vf<W> tfar) {
  vm<W> all = certain & (low >= tnear) & (high <= tfar);
  if constexpr (!AnyHit) all = all & ((high - low) * vf<W>(kNarrow) <= abs(high));
  return all.bits();
}

}  // namespace exact_filter
}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
