#include "core/exact/exact_integer.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <initializer_list>
#include <limits>

#include "core/exact/determinant.h"

namespace arboretum {
namespace {

/// What ordinary scenes get by with: a quarter of the bytes to move.
using NarrowInteger = boost::multiprecision::number<
    boost::multiprecision::cpp_int_backend<512, 512, boost::multiprecision::signed_magnitude,
                                           boost::multiprecision::unchecked, void>,
    boost::multiprecision::et_off>;
constexpr int kNarrowBits = 512;

/// x == mantissa * 2^exponent with a whole odd mantissa, or 0.
struct Parts {
  long long mantissa = 0;
  int exponent = 0;
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

template <class Integer>
Integer shifted(Integer x, int bits) {
  x <<= static_cast<unsigned>(bits);
  return x;
}

/// A common scale of points or directions: all are multiples of 2^exponent. Small ones keep the integers of ordinary
/// scenes within a few machine words.
struct Scale {
  int exponent = 0, top = 0;
  bool empty = true;

  /// `Point`: of float32 numbers or doubles.
  template <class Point>
  void include(const Point& p) {
    for (std::size_t k = 0; k < 3; ++k) {
      const Parts x = parts_of(double(p[k]));
      if (x.mantissa == 0) continue;
      const int above = x.exponent + std::bit_width(static_cast<std::uint64_t>(std::abs(x.mantissa)));
      exponent = empty ? x.exponent : std::min(exponent, x.exponent), top = empty ? above : std::max(top, above);
      empty = false;
    }
  }
  /// Every coordinate is below 2^bits() times the scale.
  [[nodiscard]] int bits() const { return top - exponent; }

  template <class Integer, class Point>
  [[nodiscard]] Triple<Integer> to_integers(const Point& p) const {
    Triple<Integer> r;
    for (std::size_t k = 0; k < 3; ++k) {
      const Parts x = parts_of(double(p[k]));
      if (x.mantissa != 0) r[k] = shifted(Integer(x.mantissa), x.exponent - exponent);
    }
    return r;
  }
};

/// Those of a line and of the triangles that it is asked about.
struct Scales {
  Scale points, directions;

  explicit Scales(const ExactLine& line, std::initializer_list<const Corners*> triangles) {
    points.include(line.origin), directions.include(line.direction);
    for (const Corners* corners : triangles)
      for (const Vec3f& p : *corners) points.include(p);
  }
  /// Bits of what is of degree `points` in differences of differences of points, and of degree 1 in the direction: a
  /// difference takes one more bit, a component of a normal one more, a sum of three two.
  [[nodiscard]] int bits_of(int degree) const { return degree * points.bits() + directions.bits() + 2 * degree + 1; }
};

template <class Integer>
Triple<Integer> difference(const Triple<Integer>& a, const Triple<Integer>& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

template <class Integer>
int sign_of(const Integer& x) {
  return x.sign() > 0 ? 1 : x.sign() < 0 ? -1 : 0;
}

/// Points in multiples of their scale, the direction of its own.
template <class Integer>
struct Scaled {
  Triple<Integer> direction, a, b, c;  // corners as seen from the origin

  Scaled(const Scales& scales, const ExactLine& line, const Corners& corners)
      : direction(scales.directions.to_integers<Integer>(line.direction)) {
    const auto seen = [&, origin = scales.points.to_integers<Integer>(line.origin)](const Vec3f& p) {
      return difference(scales.points.to_integers<Integer>(p), origin);
    };
    a = seen(corners[0]), b = seen(corners[1]), c = seen(corners[2]);
  }
};

/// t is numerator / denominator, in units of the points' scale over the direction's.
template <class Integer>
struct Quotient {
  Integer numerator, denominator;

  explicit Quotient(const Scaled<Integer>& s) {
    const Triple<Integer> normal = cross(difference(s.b, s.a), difference(s.c, s.a));
    numerator = dot(normal, s.a), denominator = dot(normal, s.direction);
  }
};

/// f(Integer()) with the narrow integers where numbers of so many bits fit them.
template <class F>
auto with_integers_of(int bits, const F& f) {
  return bits <= kNarrowBits ? f(NarrowInteger()) : f(ExactInteger());
}

ExactFraction fraction(ExactInteger numerator, ExactInteger denominator, int exponent) {
  if (denominator.sign() < 0) numerator = -numerator, denominator = -denominator;
  return {std::move(numerator), std::move(denominator), exponent};
}

int compare_scaled(const ExactInteger& a, int a_exponent, const ExactInteger& b, int b_exponent) {
  const int common = std::min(a_exponent, b_exponent);
  return shifted(a, a_exponent - common).compare(shifted(b, b_exponent - common));
}

}  // namespace

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
  const Scales scales(line, {&corners});
  return with_integers_of(scales.bits_of(2), [&]<class Integer>(const Integer&) -> std::array<int, 3> {
    const Scaled<Integer> s(scales, line, corners);
    return {sign_of(determinant(s.a, s.b, s.direction)), sign_of(determinant(s.b, s.c, s.direction)),
            sign_of(determinant(s.c, s.a, s.direction))};
  });
}

int compare_exact_t(const ExactLine& line, const Corners& first, const Corners& second) {
  const Scales scales(line, {&first, &second});
  return with_integers_of(scales.bits_of(5), [&]<class Integer>(const Integer&) {
    const Quotient<Integer> p(Scaled<Integer>(scales, line, first)), q(Scaled<Integer>(scales, line, second));
    const int order = (p.numerator * q.denominator).compare(q.numerator * p.denominator);
    return (order > 0 ? 1 : order < 0 ? -1 : 0) * sign_of(p.denominator) * sign_of(q.denominator);
  });
}

ExactFraction exact_t(const ExactLine& line, const Corners& corners) {
  const Scales scales(line, {&corners});
  const Quotient<ExactInteger> t(Scaled<ExactInteger>(scales, line, corners));
  return fraction(t.numerator, t.denominator, scales.points.exponent - scales.directions.exponent);
}

ExactPoint exact_point(const ExactLine& line, const Corners& corners) {
  const Scales scales(line, {&corners});
  const Scaled<ExactInteger> s(scales, line, corners);
  const Quotient<ExactInteger> t(s);
  return {fraction(t.numerator, t.denominator, scales.points.exponent - scales.directions.exponent),
          fraction(determinant(s.c, s.a, s.direction), t.denominator, 0),
          fraction(determinant(s.a, s.b, s.direction), t.denominator, 0)};
}

}  // namespace arboretum
