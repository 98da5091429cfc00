// The definition of truth, written out slowly in rational numbers: every triangle, no filter, no tree. For
// tests alone.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include <boost/multiprecision/cpp_int.hpp>

#include "core/mesh.h"
#include "core/ray.h"

namespace arboretum::rational {

using Number = boost::multiprecision::cpp_rational;
using Point = std::array<Number, 3>;

inline Number number(float x) {
  int exponent = 0;
  const auto mantissa = static_cast<long long>(std::ldexp(std::frexp(double(x), &exponent), 24));
  exponent -= 24;
  const boost::multiprecision::cpp_int power = boost::multiprecision::cpp_int(1) << std::abs(exponent);
  return exponent >= 0 ? Number(mantissa * power) : Number(mantissa) / Number(power);
}
inline Point point(Vec3f p) { return {number(p.x), number(p.y), number(p.z)}; }
inline Point sub(const Point& a, const Point& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
inline Number dot(const Point& a, const Point& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
/// det[a, b, c] by the rule of Sarrus.
inline Number det(const Point& a, const Point& b, const Point& c) {
  return a[0] * b[1] * c[2] + a[1] * b[2] * c[0] + a[2] * b[0] * c[1] - a[2] * b[1] * c[0] - a[1] * b[0] * c[2] -
         a[0] * b[2] * c[1];
}

struct Answer {
  std::vector<std::uint32_t> nearest;  ///< all ids at the nearest t, ascending; empty for a miss
  std::size_t hits = 0;
  Number t, u, v;  ///< u, v of the lowest id
};

/// t from the point's barycentric coordinates along the direction, not from the plane's normal: another way
/// round than the code under test.
inline Answer closest_hit(const TriangleMesh& mesh, const Ray& ray) {
  Answer answer;
  if (!is_valid(ray)) return answer;
  const Point o = point(ray.origin), d = point(ray.direction);
  for (std::uint32_t i = 0; i < mesh.size(); ++i) {
    const auto corners = mesh.corners(i);
    if (!is_finite(corners[0]) || !is_finite(corners[1]) || !is_finite(corners[2])) continue;
    const Point a = sub(point(corners[0]), o), b = sub(point(corners[1]), o), c = sub(point(corners[2]), o);
    const Number wa = det(b, c, d), wb = det(c, a, d), wc = det(a, b, d), sum = wa + wb + wc;
    const bool inside = (wa >= 0 && wb >= 0 && wc >= 0) || (wa <= 0 && wb <= 0 && wc <= 0);
    if (!inside || sum == 0) continue;
    const Number t = (wa * dot(a, d) + wb * dot(b, d) + wc * dot(c, d)) / (sum * dot(d, d));
    if (std::isinf(ray.tnear) ? ray.tnear > 0 : t < number(ray.tnear)) continue;
    if (std::isinf(ray.tfar) ? ray.tfar < 0 : t > number(ray.tfar)) continue;
    ++answer.hits;
    if (answer.nearest.empty() || t < answer.t) {
      answer.nearest = {i}, answer.t = t, answer.u = wb / sum, answer.v = wc / sum;
    } else if (t == answer.t) {
      answer.nearest.push_back(i);
    }
  }
  return answer;
}

/// Whether `f` is the float32 nearest to `x` (ties to even), by looking at its two neighbours.
inline bool is_rounded(const Number& x, float f) {
  if (!std::isfinite(f)) return abs(x) >= number(std::numeric_limits<float>::max());
  const float infinity = std::numeric_limits<float>::infinity();
  const Number error = abs(x - number(f));
  for (float next : {std::nextafter(f, infinity), std::nextafter(f, -infinity)}) {
    if (!std::isfinite(next)) continue;
    const Number other = abs(x - number(next));
    if (other < error) return false;
    if (other == error && (std::bit_cast<std::uint32_t>(f) & 1u) != 0) return false;
  }
  return true;
}

}  // namespace arboretum::rational
