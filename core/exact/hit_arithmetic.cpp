// The level in doubles. With e1 = b - a, e2 = c - a, s = o - a (one rounding each of float32 differences, u = 2^-53),
//   det = e1.(d x e2),  t = e2.(s x e1) / det,  weights s.(d x e2) / det and d.(s x e1) / det  (Moeller and Trumbore,
//   JGT 1997).
// Each of the six products of a determinant carries at most eight factors (1 + e), |e| <= u: three rounded differences,
// the product, its difference, the second product, two sums; so with |.| the largest component it is off by less than
// 6 * 8.01 u |.||.||.|, and kDeterminant (double_bounds.h) = 56 u leaves room for the roundings of that bound. As in
// exact_predicate.cpp nothing can under- or overflow.
#include "core/exact/hit_arithmetic.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <emmintrin.h>

#include "core/exact/double_bounds.h"
#include "core/exact/exact_predicate.h"
#include "core/rounding.h"

namespace arboretum {
namespace {

/// Two triples of doubles side by side: what is done to one is done to the other in the same instruction.
struct Pair3 {
  __m128d x, y, z;
};
Pair3 operator-(const Pair3& a, const Pair3& b) {
  return {_mm_sub_pd(a.x, b.x), _mm_sub_pd(a.y, b.y), _mm_sub_pd(a.z, b.z)};
}
Pair3 pair(Vec3f low, Vec3f high) {
  return {_mm_setr_pd(low.x, high.x), _mm_setr_pd(low.y, high.y), _mm_setr_pd(low.z, high.z)};
}
__m128d swapped(__m128d a) { return _mm_shuffle_pd(a, a, 1); }
Pair3 swapped(const Pair3& a) { return {swapped(a.x), swapped(a.y), swapped(a.z)}; }
__m128d difference_of_products(__m128d a, __m128d b, __m128d c, __m128d d) {
  return _mm_sub_pd(_mm_mul_pd(a, b), _mm_mul_pd(c, d));
}
Pair3 cross(const Pair3& a, const Pair3& b) {
  return {difference_of_products(a.y, b.z, a.z, b.y), difference_of_products(a.z, b.x, a.x, b.z),
          difference_of_products(a.x, b.y, a.y, b.x)};
}
__m128d dot(const Pair3& a, const Pair3& b) {
  return _mm_add_pd(_mm_add_pd(_mm_mul_pd(a.x, b.x), _mm_mul_pd(a.y, b.y)), _mm_mul_pd(a.z, b.z));
}
__m128d size_of(const Pair3& a) {
  const __m128d sign = _mm_set1_pd(-0.0);
  return _mm_max_pd(_mm_max_pd(_mm_andnot_pd(sign, a.x), _mm_andnot_pd(sign, a.y)), _mm_andnot_pd(sign, a.z));
}
double low(__m128d a) { return _mm_cvtsd_f64(a); }
double high(__m128d a) { return _mm_cvtsd_f64(_mm_unpackhi_pd(a, a)); }

/// t within `radius` of the exact one, infinite where the determinant may be near 0; weights of the second and third
/// corner within `weight_radius`.
struct DoublePoint {
  double t, radius, u, v, weight_radius;
};

inline DoublePoint point_in_double(const Ray& ray, const Corners& corners) {
  const Vec3f a = corners[0];
  const Pair3 e = pair(corners[1], corners[2]) - pair(a, a);            // e1, e2
  const Pair3 ds = pair(ray.direction, ray.origin) - pair(Vec3f{}, a);  // d, s
  const Pair3 pq = cross(ds, swapped(e));                               // d x e2, s x e1
  const __m128d det_t = dot(e, pq), weights = dot(swapped(ds), pq);
  const __m128d size_e = size_of(e), size_ds = size_of(ds);
  const __m128d det = _mm_unpacklo_pd(det_t, det_t);
  // (n + dn) / (det + dd) - n / det = (dn - (n / det) dd) / (det + dd), and dd is at most 2^-9 |det|.
  const __m128d inverse = _mm_div_pd(_mm_set1_pd(1.0), det);
  const __m128d scale_t = _mm_mul_pd(
      _mm_shuffle_pd(_mm_set1_pd(double_bounds::kDeterminant * double_bounds::kQuotient), det_t, 2), inverse);
  const __m128d uv = _mm_mul_pd(weights, inverse);
  const double t = high(scale_t), scale = std::fabs(low(scale_t)), size_1 = low(size_e), size_2 = high(size_e);
  const double size_d = low(size_ds), size_s = high(size_ds), det_error = scale * size_1 * size_2 * size_d;
  if (!(det_error < double_bounds::kMostOfDivisor))
    return {t, std::numeric_limits<double>::infinity(), low(uv), high(uv), 1.0};
  return {t, scale * size_1 * size_2 * size_s + std::fabs(t) * (det_error + double_bounds::kRounding), low(uv),
          high(uv), scale * size_d * size_s * std::max(size_1, size_2) + det_error + double_bounds::kRounding};
}

/// Of zeros the one without a sign.
float weight(double w) { return w > 0.0 ? static_cast<float>(std::min(w, 1.0)) : 0.0f; }

}  // namespace

bool meets_exactly(const Ray& ray, const Corners& corners, DistanceInterval& t) noexcept {
  ExactPredicate predicate(ray);
  Enclosure e;
  if (!predicate.meets(corners, e)) return false;
  t = {rounded_down(e.lower), rounded_up(e.upper)};
  return true;
}

int compare_distances_exactly(const Ray& ray, const Corners& first, const Corners& second) noexcept {
  const DoublePoint p = point_in_double(ray, first), q = point_in_double(ray, second);
  // 2^-50 of each t is in its radius, more than what this sum and this difference round by.
  if (std::fabs(p.t - q.t) > p.radius + q.radius) return p.t < q.t ? -1 : 1;
  return ExactPredicate(ray).compare_t(first, second);
}

RoundedHit round_exactly(const Ray& ray, const Corners& corners) noexcept {
  const DoublePoint p = point_in_double(ray, corners);
  const float t = static_cast<float>(p.t - p.radius) + 0.0f;  // of zeros the one without a sign
  if (t == static_cast<float>(p.t + p.radius) && p.weight_radius < double_bounds::kWeight)
    return {t, weight(p.u), weight(p.v)};
  const RoundedPoint exact = ExactPredicate(ray).round(corners);
  return {exact.t_rounded, exact.u, exact.v};
}

}  // namespace arboretum
