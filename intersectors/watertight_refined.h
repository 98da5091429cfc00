// The watertight test (intersectors/watertight.h) for the search, and t, u and v of the hit that won computed again in
// double from its corners: the coverage and very nearly the speed of the one, the distances of the other. Which
// triangle wins is still decided by the float t: of two surfaces within its error of each other, the farther may be
// reported, with its own right distance.
//
// t is right to half a unit in the last place, and a little, unless the ray grazes (relative error some 2^-50 times
// |e1||e2||d| / |N.d|). Where doubles leave open where in the triangle the ray is, exact arithmetic says whether it
// meets it, and where. Where the exact ray passes outside the triangle, by less than the search rounds but by more than
// doubles do, the hit is the triangle's nearest point in barycentrics, since the plane at the ray may be far off; t
// stays within [tnear, tfar]. 36 bytes a triangle (vertices) or 12 (indices).
#pragma once

#include "core/exact/double_bounds.h"
#include "core/exact/hit_arithmetic.h"
#include "intersectors/leaf_block.h"
#include "intersectors/moller_trumbore.h"
#include "intersectors/watertight.h"
#include "simd/double.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

struct WatertightRefined : Watertight {
  static constexpr std::string_view kName = "watertight_refined";
  static constexpr bool kEveryLeaf = false;

  /// `corner`: of the nearest hit so far, by corner and axis.
  struct RayData : Watertight::RayData {
    float origin[3], towards[3], tfar;
    float corner[3][3];
    ARBORETUM_INLINE explicit RayData(const Ray& ray)
        : Watertight::RayData(ray), origin{ray.origin.x, ray.origin.y, ray.origin.z}, towards{ray.direction.x,
                                                                                              ray.direction.y,
                                                                                              ray.direction.z},
          tfar(ray.tfar) {}
  };

  template <class Block>
  static ARBORETUM_INLINE void accept(RayData& ray, const Block& block, int lane) {
    for (int axis = 0; axis < 3; ++axis) {
      ray.corner[0][axis] = block.v0[axis][lane];
      ray.corner[1][axis] = block.v1[axis][lane];
      ray.corner[2][axis] = block.v2[axis][lane];
    }
  }

  static void finish(RayData& ray, NearestHit& best) {
    const auto widened = [](const float(&p)[3]) { return load3<1>(&p[0], &p[1], &p[2]); };
    const vd3<1> o = widened(ray.origin), d = widened(ray.towards);
    const vd3<1> v0 = widened(ray.corner[0]), e1 = v0 - widened(ray.corner[1]), e2 = widened(ray.corner[2]) - v0;
    const MollerTrumboreTerms<vd<1>> terms(v0, e1, e2, o, d);
    const double det = terms.det.v;
    if (det == 0.0) return;  // an answer of the search alone
    double u = terms.u.v / det, v = terms.v.v / det, t = dot(terms.n, terms.c).v / det;
    const auto size = [](vd3<1> p) { return std::max({std::abs(p.x.v), std::abs(p.y.v), std::abs(p.z.v)}); };
    // Of u and v, as of the weights of `exact` (core/exact/hit_arithmetic.cpp).
    const double scale = double_bounds::kDeterminant * double_bounds::kQuotient / std::abs(det),
                 error = scale * size(d) * (size(terms.c) * std::max(size(e1), size(e2)) + size(e1) * size(e2)) +
                         double_bounds::kRounding;
    // Where doubles cannot tell where in the triangle the ray is, or whether it is: seen edge on, or a needle.
    if (__builtin_expect(!(error < 0x1p-10), 0) && round_if_met(ray, best)) return;
    const double outside = std::max({-u, -v, 0.5 * (u + v - 1.0)});
    if (error < 0x1p-10 && outside <= error) {  // beyond, the plane may be anywhere
      u = std::clamp(u, 0.0, 1.0), v = std::clamp(v, 0.0, 1.0 - u);
    } else if (outside > 0.0) {
      u = u > 0.0 ? u : 0.0, v = v > 0.0 ? v : 0.0;
      if (u + v > 1.0) {
        const double sum = u + v;
        u /= sum, v /= sum;
      }
      const auto along = [&](vd3<1> p) { return dot(p, d).v; };
      t = (along(terms.c) - u * along(e1) + v * along(e2)) / along(d);
    }
    const float rounded = float(t);
    best.t = rounded < ray.tnear() ? ray.tnear() : rounded > ray.tfar ? ray.tfar : rounded;
    best.u = float(u), best.v = float(v);
  }

 private:
  /// The hit by exact arithmetic, if the exact ray meets the triangle within its interval; else false, and nothing.
  static __attribute__((noinline)) bool round_if_met(const RayData& ray, NearestHit& best) {
    const auto point = [](const float(&p)[3]) { return Vec3f{p[0], p[1], p[2]}; };
    const Ray exact{point(ray.origin), ray.tnear(), point(ray.towards), ray.tfar};
    const std::array<Vec3f, 3> corners{point(ray.corner[0]), point(ray.corner[1]), point(ray.corner[2])};
    DistanceInterval interval;
    if (!meets_exactly(exact, corners, interval)) return false;
    const RoundedHit hit = round_exactly(exact, corners);
    best.t = std::clamp(hit.t, exact.tnear, exact.tfar), best.u = hit.u, best.v = hit.v;
    return true;
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
