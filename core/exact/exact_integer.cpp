#include "core/exact/exact_integer.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "core/exact/determinant.h"

namespace arboretum {
namespace {

using IntegerTriple = Triple<ExactInteger>;

/// x == mantissa * 2^exponent with a whole mantissa; exponent is INT_MAX for 0.
struct Parts {
  long long mantissa = 0;
  int exponent = std::numeric_limits<int>::max();
};

Parts parts_of(double x) {
  if (x == 0.0) return {};
  const auto bits = std::bit_cast<std::uint64_t>(x);
  const int field = static_cast<int>(bits >> 52 & 0x7ff);
  const std::uint64_t fraction = bits & 0xfffffffffffffu;
  const std::uint64_t whole = field == 0 ? fraction : fraction | 0x10000000000000u;
  const int zeros = std::countr_zero(whole);
  const auto mantissa = static_cast<long long>(whole >> zeros);
  return {x < 0 ? -mantissa : mantissa, std::max(field, 1) - 1075 + zeros};
}

ExactInteger shifted(ExactInteger x, int bits) {
  x <<= static_cast<unsigned>(bits);
  return x;
}

/// `Point`: of float32 numbers or doubles.
template <class Point>
void lower_exponent(int& exponent, const Point& p) {
  for (std::size_t k = 0; k < 3; ++k) exponent = std::min(exponent, parts_of(double(p[k])).exponent);
}

template <class Point>
IntegerTriple to_integers(const Point& p, int exponent) {
  IntegerTriple r;
  for (std::size_t k = 0; k < 3; ++k) {
    const Parts x = parts_of(double(p[k]));
    r[k] = x.mantissa == 0 ? ExactInteger(0) : shifted(ExactInteger(x.mantissa), x.exponent - exponent);
  }
  return r;
}

IntegerTriple difference(const IntegerTriple& a, const IntegerTriple& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

int sign_of(const ExactInteger& x) { return x.sign() > 0 ? 1 : x.sign() < 0 ? -1 : 0; }

/// Points in multiples of 2^point_exponent, the direction in multiples of 2^direction_exponent: small common
/// scales keep the integers of ordinary scenes within a few machine words.
struct Scaled {
  int point_exponent = std::numeric_limits<int>::max();
  int direction_exponent = std::numeric_limits<int>::max();
  IntegerTriple direction, a, b, c;  // corners as seen from the origin

  Scaled(const ExactLine& line, const Corners& corners) {
    lower_exponent(direction_exponent, line.direction);
    lower_exponent(point_exponent, line.origin);
    for (const Vec3f& p : corners) lower_exponent(point_exponent, p);
    if (point_exponent == std::numeric_limits<int>::max()) point_exponent = 0;
    if (direction_exponent == std::numeric_limits<int>::max()) direction_exponent = 0;
    direction = to_integers(line.direction, direction_exponent);
    const IntegerTriple origin = to_integers(line.origin, point_exponent);
    a = difference(to_integers(corners[0], point_exponent), origin);
    b = difference(to_integers(corners[1], point_exponent), origin);
    c = difference(to_integers(corners[2], point_exponent), origin);
  }
};

ExactFraction fraction(ExactInteger numerator, ExactInteger denominator, int exponent) {
  if (denominator.sign() < 0) numerator = -numerator, denominator = -denominator;
  return {std::move(numerator), std::move(denominator), exponent};
}

int compare_scaled(const ExactInteger& a, int a_exponent, const ExactInteger& b, int b_exponent) {
  const int common = std::min(a_exponent, b_exponent);
  return shifted(a, a_exponent - common).compare(shifted(b, b_exponent - common));
}

}  // namespace

int compare(const ExactFraction& a, const ExactFraction& b) {
  const int sign_a = sign_of(a.numerator), sign_b = sign_of(b.numerator);
  if (sign_a != sign_b) return sign_a < sign_b ? -1 : 1;
  const int c = compare_scaled(a.numerator * b.denominator, a.exponent, b.numerator * a.denominator, b.exponent);
  return c > 0 ? 1 : c < 0 ? -1 : 0;
}

int compare(const ExactFraction& a, double x) {
  const int sign_a = sign_of(a.numerator), sign_x = x > 0 ? 1 : x < 0 ? -1 : 0;
  if (sign_a != sign_x) return sign_a < sign_x ? -1 : 1;
  if (sign_a == 0) return 0;
  const Parts p = parts_of(x);
  const int c = compare_scaled(a.numerator, a.exponent, a.denominator * ExactInteger(p.mantissa), p.exponent);
  return c > 0 ? 1 : c < 0 ? -1 : 0;
}

double to_double(const ExactFraction& a) {
  if (a.numerator.is_zero()) return 0.0;
  const bool negative = a.numerator.sign() < 0;
  ExactInteger n = negative ? ExactInteger(-a.numerator) : a.numerator;
  ExactInteger d = a.denominator;
  // A quotient of 64 or 65 bits, cut off: the cut is below a thousandth of the double's last place.
  const int shift = 64 - (static_cast<int>(msb(n)) - static_cast<int>(msb(d)));
  if (shift >= 0) {
    n <<= static_cast<unsigned>(shift);
  } else {
    d <<= static_cast<unsigned>(-shift);
  }
  const ExactInteger q = n / d;
  const double value = std::ldexp(q.convert_to<double>(), a.exponent - shift);
  return negative ? -value : value;
}

float round_to_float(const ExactFraction& a) {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  constexpr double kLargest = 0x1.ffffffp+127;  // halfway between the largest float32 and 2^128
  const double approximate = to_double(a);
  if (std::fabs(approximate) > 2 * kLargest) return approximate > 0 ? kInfinity : -kInfinity;
  constexpr double kMax = std::numeric_limits<float>::max();
  const float value = static_cast<float>(std::clamp(approximate, -kMax, kMax));
  // The conversion may have gone to the wrong neighbour where the value lies beside a midpoint: settle it
  // exactly.
  for (int direction : {1, -1}) {
    const float next = std::nextafter(value, direction > 0 ? kInfinity : -kInfinity);
    const double midpoint = std::isinf(next) ? direction * kLargest : 0.5 * (double(value) + double(next));
    const int side = compare(a, midpoint) * direction;
    if (side > 0) return next;
    if (side < 0) continue;
    // Ties to even: the even mantissa of the two neighbours is the one whose bit pattern is even.
    return (std::bit_cast<std::uint32_t>(value) & 1u) == 0 ? value : next;
  }
  return value;
}

std::array<int, 3> exact_edge_signs(const ExactLine& line, const Corners& corners) {
  const Scaled s(line, corners);
  return {sign_of(determinant(s.a, s.b, s.direction)), sign_of(determinant(s.b, s.c, s.direction)),
          sign_of(determinant(s.c, s.a, s.direction))};
}

ExactFraction exact_t(const ExactLine& line, const Corners& corners) {
  const Scaled s(line, corners);
  const IntegerTriple normal = cross(difference(s.b, s.a), difference(s.c, s.a));
  return fraction(dot(normal, s.a), dot(normal, s.direction), s.point_exponent - s.direction_exponent);
}

ExactPoint exact_point(const ExactLine& line, const Corners& corners) {
  const Scaled s(line, corners);
  const IntegerTriple normal = cross(difference(s.b, s.a), difference(s.c, s.a));
  const ExactInteger denominator = dot(normal, s.direction);
  return {fraction(dot(normal, s.a), denominator, s.point_exponent - s.direction_exponent),
          fraction(determinant(s.c, s.a, s.direction), denominator, 0),
          fraction(determinant(s.a, s.b, s.direction), denominator, 0)};
}

}  // namespace arboretum
