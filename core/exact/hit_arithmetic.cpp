// The level in doubles. With e1 = b - a, e2 = c - a, s = o - a (one rounding each of float32 differences, u = 2^-53),
//   det = e1.(d x e2),  t = e2.(s x e1) / det,  weights s.(d x e2) / det and d.(s x e1) / det  (Moeller and Trumbore, JGT 1997).
// Each of the six products of a determinant carries at most eight factors (1 + e), |e| <= u: three rounded differences, the
// product, its difference, the second product, two sums; so with |.| the largest component it is off by less than
// 6 * 8.01 u |.||.||.|, and kBound = 56 u leaves room for the roundings of that bound. As in exact_predicate.cpp nothing can
// under- or overflow.
#include "core/exact/hit_arithmetic.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/exact/exact_predicate.h"

namespace arboretum {
namespace {

constexpr double kBound = 56 * 0x1p-53;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct Double3 {
  double x, y, z;
};
Double3 difference(Vec3f a, Vec3f b) {
  return {double(a.x) - double(b.x), double(a.y) - double(b.y), double(a.z) - double(b.z)};
}
Double3 cross(Double3 a, Double3 b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
double dot(Double3 a, Double3 b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
double size_of(Double3 a) {
  return std::max(std::max(std::fabs(a.x), std::fabs(a.y)), std::fabs(a.z));
}

/// t within `radius` of the exact one, infinite where the determinant may be near 0; weights of the second and third corner within
/// `weight_radius`.
struct DoublePoint {
  double t, radius, u, v, weight_radius;
};

DoublePoint point_in_double(const Ray& ray, const Corners& corners) {
  const Double3 d{ray.direction.x, ray.direction.y, ray.direction.z};
  const Double3 e1 = difference(corners[1], corners[0]), e2 = difference(corners[2], corners[0]), s = difference(ray.origin, corners[0]);
  const Double3 p = cross(d, e2), q = cross(s, e1);
  const double det = dot(e1, p), inverse = 1.0 / det;
  const double size_d = size_of(d), size_1 = size_of(e1), size_2 = size_of(e2), size_s = size_of(s);
  DoublePoint r{dot(e2, q) * inverse, 0.0, dot(s, p) * inverse, dot(d, q) * inverse, 0.0};
  // (n + dn) / (det + dd) - n / det = (dn - (n / det) dd) / (det + dd), and dd is at most 2^-9 |det|.
  const double scale = kBound * (1 + 0x1p-8) * std::fabs(inverse);
  const double det_error = scale * size_d * size_1 * size_2;
  if (!(det_error < 0x1p-9)) return {r.t, std::numeric_limits<double>::infinity(), r.u, r.v, 1.0};
  r.radius = scale * size_1 * size_2 * size_s + std::fabs(r.t) * (det_error + 0x1p-50);
  r.weight_radius = scale * size_d * size_s * std::max(size_1, size_2) + det_error + 0x1p-50;
  return r;
}

float rounded_down(double x) {
  const float f = static_cast<float>(x);
  return double(f) > x ? std::nextafter(f, -kInfinity) : f;
}
float rounded_up(double x) {
  const float f = static_cast<float>(x);
  return double(f) < x ? std::nextafter(f, kInfinity) : f;
}

float weight(double w) {
  return static_cast<float>(std::clamp(w, 0.0, 1.0));
}

}  // namespace

bool meets_exactly(const Ray& ray, const Corners& corners, DistanceInterval& t) noexcept {
  ExactPredicate predicate(ray);
  Enclosure e;
  if (!predicate.meets(corners, e)) return false;
  t = {rounded_down(e.lower), rounded_up(e.upper)};
  return true;
}

DistanceInterval distance_in_double(const Ray& ray, const Corners& corners) noexcept {
  const DoublePoint p = point_in_double(ray, corners);
  if (!(p.radius < double(kInfinity))) return {-kInfinity, kInfinity};
  return {rounded_down(p.t - p.radius), rounded_up(p.t + p.radius)};
}

int compare_distances_exactly(const Ray& ray, const Corners& first, const Corners& second) noexcept {
  const DoublePoint p = point_in_double(ray, first), q = point_in_double(ray, second);
  // 2^-50 of each t is in its radius, more than what this sum and this difference round by.
  if (std::fabs(p.t - q.t) > p.radius + q.radius) return p.t < q.t ? -1 : 1;
  return ExactPredicate(ray).compare_t(first, second);
}

RoundedHit round_exactly(const Ray& ray, const Corners& corners) noexcept {
  const DoublePoint p = point_in_double(ray, corners);
  const float t = static_cast<float>(p.t - p.radius);
  if (t == static_cast<float>(p.t + p.radius) && p.weight_radius < 0x1p-30) return {t, weight(p.u), weight(p.v)};
  const RoundedPoint exact = ExactPredicate(ray).round(corners);
  return {exact.t_rounded, exact.u, exact.v};
}

}  // namespace arboretum
