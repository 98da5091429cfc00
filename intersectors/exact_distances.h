// The distances that the filter of `exact` leaves open, in doubles: t of triangles' planes with bounds on its error.
#pragma once

#include <limits>

#include "core/exact/double_bounds.h"
#include "intersectors/triangle_hits.h"
#include "simd/double.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {
namespace exact_filter {

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
    // Rounding to floats takes at most half of this from either end. (Of a subnormal t much less; but see kLeast.)
    const auto ulp = [](F x) { return madd(abs(x), F(0x1p-23f), F(std::numeric_limits<float>::min())); };
    const vm<W> narrowed = vm<W>::from_bits(usable);
    const F new_low = to_floats<W>(low), new_high = to_floats<W>(high);
    l = select(narrowed, max_x86(new_low - ulp(new_low), l), l);
    h = select(narrowed, min_x86(new_high + ulp(new_high), h), h);
  }
};

template <int D>
ARBORETUM_INLINE vd3<D> in_doubles(const Vec3f& p) {
  return {vd<D>(double(p.x)), vd<D>(double(p.y)), vd<D>(double(p.z))};
}

}  // namespace exact_filter
}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
