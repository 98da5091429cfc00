// Error bounds. u = 2^-53. Every operand is a float32, a multiple of 2^-149 below 2^128 in size (an origin with more
// digits is one too, and whatever is said of differences holds for it: they are rounded once, and exact as
// double-doubles); so every value of degree three here is 0 or between 2^-447 and 2^390, a quotient of two such between
// 2^-840 and 2^840, and the low parts of double-doubles are multiples of the same grids: nothing under- or overflows
// and relative bounds hold throughout.
//
// det[p, q, r] in doubles: p and q are differences of float32 numbers (one rounding each), then there are
// five roundings on the longest way (determinant.h): each of the six products carries at most seven factors
// (1 + e), |e| <= u. With |p|, |q|, |r| the largest components the products sum to at most 6 |p||q||r|, so
// the error is below 6 * 7.01 u |p||q||r|. r itself may be such a difference: eight factors, 6 * 8.01 u
// = 48.1 u. kDoubleBound = 56 u leaves room for the roundings of |p|, |q|, |r| and of the bound itself.
//
// In double-doubles the differences are exact, five operations remain, each within 10 * 2^-106: 6 * 5.01 * 10
// * 2^-106 < 2^-97.
#include "core/exact/exact_predicate.h"
#include "core/exact/double_bounds.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace arboretum {
namespace {

constexpr double kDoubleBound = double_bounds::kDeterminant;
constexpr double kDoubleDoubleBound = 0x1p-96;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Rounding may leave -0 of a zero: an answer is 0, as kernels have it.
float without_sign_of_zero(float x) { return x + 0.0f; }

Triple<double> widen(Vec3f p) { return {p.x, p.y, p.z}; }

Triple<double> operator-(const Triple<double>& a, const Triple<double>& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

/// Exact.
Triple<DoubleDouble> difference(const Triple<double>& a, const Triple<double>& b) {
  return {two_sum(a[0], -b[0]), two_sum(a[1], -b[1]), two_sum(a[2], -b[2])};
}

double size_of(const Triple<double>& a) { return std::max({std::fabs(a[0]), std::fabs(a[1]), std::fabs(a[2])}); }
double size_of(const Triple<DoubleDouble>& a) {
  return std::max({std::fabs(a[0].hi), std::fabs(a[1].hi), std::fabs(a[2].hi)});
}

int sign_beyond(double value, double bound) { return value > bound ? 1 : value < -bound ? -1 : 0; }

/// a * b == c * d exactly: the two parts of a product are unique.
bool equal_products(double a, double b, double c, double d) {
  const DoubleDouble p = two_product(a, b), q = two_product(c, d);
  return p.hi == q.hi && p.lo == q.lo;
}

/// Whether two triangles lie in one plane as their corners say without arithmetic: all across one axis, or the same in
/// whatever order. Models have walls of many triangles, and triangles twice.
bool clearly_in_one_plane(const Corners& first, const Corners& second) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto there = [&](Vec3f p) { return p[axis] == first[0][axis]; };
    if (std::ranges::all_of(first, there) && std::ranges::all_of(second, there)) return true;
  }
  return std::ranges::is_permutation(first, second);
}

double down(double x) { return std::nextafter(x, -kInfinity); }
double up(double x) { return std::nextafter(x, kInfinity); }

/// Half the width of an interval around numerator / denominator, given the errors of both, rounding of the
/// quotient not counted: (n + dn) / (d + dd) - n / d = (dn - (n / d) dd) / (d + dd). Infinite where the
/// denominator may be near 0.
double quotient_error(double quotient, double numerator_error, double denominator, double denominator_error) {
  const double size = std::fabs(denominator);
  if (!(size > 2 * denominator_error)) return kInfinity;
  return (numerator_error + std::fabs(quotient) * denominator_error) / (size - denominator_error) * (1 + 0x1p-48);
}

}  // namespace

/// A quotient in double-double: the exact value is within `radius` of it.
struct ExactPredicate::Approximate {
  DoubleDouble value;
  double radius = kInfinity;

  static Approximate quotient(DoubleDouble n, double n_error, DoubleDouble d, double d_error) {
    Approximate r;
    if (!(std::fabs(d.hi) > 4 * d_error)) return r;
    r.value = n / d;
    r.radius = quotient_error(r.value.hi, n_error, d.hi, d_error * 1.5) + std::fabs(r.value.hi) * 0x1p-96;
    return r;
  }
  [[nodiscard]] bool usable() const { return radius < kInfinity; }
  [[nodiscard]] Enclosure enclosure() const {
    return {down(value.hi + (value.lo - radius)), up(value.hi + (value.lo + radius))};
  }
};

ExactPredicate::ExactPredicate(const Ray& ray) noexcept : ExactPredicate(ray, widen(ray.origin)) {}

ExactPredicate::ExactPredicate(const Ray& ray, const std::array<double, 3>& origin) noexcept
    : line_{origin, ray.direction}, origin_(origin), direction_(widen(ray.direction)), tnear_(ray.tnear),
      tfar_(ray.tfar), direction_size_(size_of(direction_)) {}

bool ExactPredicate::surely_on_line(Vec3f point) const {
  const Triple<DoubleDouble> s = difference(widen(point), origin_);
  if (s[0].lo != 0 || s[1].lo != 0 || s[2].lo != 0) return false;
  const Triple<double>& d = direction_;
  return equal_products(s[0].hi, d[1], s[1].hi, d[0]) && equal_products(s[1].hi, d[2], s[2].hi, d[1]) &&
         equal_products(s[2].hi, d[0], s[0].hi, d[2]);
}

bool ExactPredicate::meets(const Corners& corners, Enclosure& t) {
  const Triple<double> at[3] = {widen(corners[0]), widen(corners[1]), widen(corners[2])};
  // det[p, q, d] = det[p, q - p, d], whose rounding is of the edge's size, not of the corners' distance.
  int sign[3];
  for (int k = 0; k < 3; ++k) {
    const Triple<double> p = at[k] - origin_, edge = at[(k + 1) % 3] - at[k];
    sign[k] =
        sign_beyond(determinant(p, edge, direction_), kDoubleBound * direction_size_ * size_of(p) * size_of(edge));
  }
  const auto mixed = [&sign] {
    return std::min({sign[0], sign[1], sign[2]}) < 0 && std::max({sign[0], sign[1], sign[2]}) > 0;
  };
  ++counts_.in_double;
  if (mixed()) return false;
  if (sign[0] == 0 || sign[1] == 0 || sign[2] == 0) {
    // A corner on the line: both its edges are exactly 0. So it is for all triangles of a fan, where whole numbers
    // would take their time.
    bool zero[3] = {false, false, false};
    for (int k = 0; k < 3; ++k)
      if (sign[k] == 0 && sign[(k + 2) % 3] == 0 && surely_on_line(corners[static_cast<std::size_t>(k)]))
        zero[k] = zero[(k + 2) % 3] = true;
    bool all_certain = true;
    for (int k = 0; k < 3; ++k) {
      if (sign[k] != 0 || zero[k]) continue;
      bool certain = false;
      sign[k] = edge_sign_in_double_double(difference(at[k], origin_), difference(at[(k + 1) % 3], at[k]),
                                           direction_size_, certain);
      all_certain = all_certain && certain;
    }
    ++counts_.in_double_double;
    if (mixed()) return false;
    if (!all_certain) {
      ++counts_.in_integers;
      const std::array<int, 3> exact = exact_edge_signs(line_, corners);
      std::copy(exact.begin(), exact.end(), sign);
      if (mixed()) return false;
    }
    if (sign[0] == 0 && sign[1] == 0 && sign[2] == 0) return false;
  }
  return within_interval(corners, t);
}

int ExactPredicate::edge_sign_in_double_double(const Triple<DoubleDouble>& p, const Triple<DoubleDouble>& q,
                                               double scale, bool& certain) const {
  const Triple<DoubleDouble> d{DoubleDouble{direction_[0]}, DoubleDouble{direction_[1]}, DoubleDouble{direction_[2]}};
  const int sign = sign_beyond(determinant(p, q, d).hi, kDoubleDoubleBound * scale * size_of(p) * size_of(q));
  certain = sign != 0;
  return sign;
}

ExactPredicate::Approximate ExactPredicate::approximate_t(const Corners& corners) const {
  const Triple<double> pa = widen(corners[0]);
  const Triple<DoubleDouble> a = difference(pa, origin_), e1 = difference(widen(corners[1]), pa),
                             e2 = difference(widen(corners[2]), pa);
  const Triple<DoubleDouble> d{DoubleDouble{direction_[0]}, DoubleDouble{direction_[1]}, DoubleDouble{direction_[2]}};
  const Triple<DoubleDouble> normal = cross(e1, e2);
  const double scale = kDoubleDoubleBound * size_of(e1) * size_of(e2);
  return Approximate::quotient(dot(normal, a), scale * size_of(a), dot(normal, d), scale * direction_size_);
}

bool ExactPredicate::within_interval(const Corners& corners, Enclosure& t) {
  const auto decided = [&](const Enclosure& e, bool& inside) {
    if (e.upper < tnear_ || e.lower > tfar_) return inside = false, true;
    if (e.lower >= tnear_ && e.upper <= tfar_) return inside = true, true;
    return false;
  };
  bool inside = false;
  {
    const Triple<double> pa = widen(corners[0]), a = pa - origin_, e1 = widen(corners[1]) - pa,
                         e2 = widen(corners[2]) - pa, normal = cross(e1, e2);
    const double scale = kDoubleBound * size_of(e1) * size_of(e2), denominator = dot(normal, direction_);
    const double quotient = dot(normal, a) / denominator;
    // The last term covers the rounding of the quotient and of the two interval ends.
    const double radius = quotient_error(quotient, scale * size_of(a), denominator, scale * direction_size_) +
                          std::fabs(quotient) * 0x1p-51;
    if (radius < kInfinity) {
      t = {quotient - radius, quotient + radius};
      if (decided(t, inside)) return ++counts_.in_double, inside;
    }
  }
  const Approximate approximate = approximate_t(corners);
  if (approximate.usable()) {
    t = approximate.enclosure();
    if (decided(t, inside)) return ++counts_.in_double_double, inside;
  }
  ++counts_.in_integers;
  const ExactFraction exact = exact_t(line_, corners);
  const double rounded = to_double(exact);
  t = rounded == 0.0 ? Enclosure{0.0, 0.0} : Enclosure{down(rounded), up(rounded)};
  const auto not_below = [&](double limit) { return std::isinf(limit) ? limit < 0 : compare(exact, limit) >= 0; };
  const auto not_above = [&](double limit) { return std::isinf(limit) ? limit > 0 : compare(exact, limit) <= 0; };
  return not_below(tnear_) && not_above(tfar_);
}

int ExactPredicate::compare_t(const Corners& first, const Corners& second) {
  if (clearly_in_one_plane(first, second)) return 0;
  // A corner of both on the line is where it meets both.
  for (const Vec3f& corner : first)
    if (std::find(second.begin(), second.end(), corner) != second.end() && surely_on_line(corner))
      return ++counts_.in_double_double, 0;
  const Approximate p = approximate_t(first), q = approximate_t(second);
  if (p.usable() && q.usable()) {
    const DoubleDouble difference = p.value - q.value;
    const double bound =
        (p.radius + q.radius) * (1 + 0x1p-50) + (std::fabs(p.value.hi) + std::fabs(q.value.hi)) * 0x1p-100;
    if (const int sign = sign_beyond(difference.hi, bound)) return ++counts_.in_double_double, sign;
  }
  ++counts_.in_integers;
  return compare_exact_t(line_, first, second);
}

RoundedPoint ExactPredicate::round(const Corners& corners) {
  const Triple<DoubleDouble> d{DoubleDouble{direction_[0]}, DoubleDouble{direction_[1]}, DoubleDouble{direction_[2]}};
  const Triple<double> pa = widen(corners[0]), pb = widen(corners[1]), pc = widen(corners[2]);
  const Triple<DoubleDouble> a = difference(pa, origin_), b = difference(pb, origin_), c = difference(pc, origin_),
                             e1 = difference(pb, pa), e2 = difference(pc, pa), normal = cross(e1, e2);
  const double scale = kDoubleDoubleBound * size_of(e1) * size_of(e2);
  const DoubleDouble denominator = dot(normal, d);
  const double denominator_error = scale * direction_size_;
  const double edge_scale = kDoubleDoubleBound * direction_size_ * size_of(a);
  const Approximate point[3] = {
      Approximate::quotient(dot(normal, a), scale * size_of(a), denominator, denominator_error),
      Approximate::quotient(determinant(c, a, d), edge_scale * size_of(c), denominator, denominator_error),
      Approximate::quotient(determinant(a, b, d), edge_scale * size_of(b), denominator, denominator_error)};
  float rounded[3];
  bool certain = std::fabs(point[0].value.hi) * 0x1p-54 >= point[0].radius;
  for (int k = 0; k < 3 && certain; ++k) {
    if (!point[k].usable()) {
      certain = false;
      break;
    }
    const Enclosure e = point[k].enclosure();
    constexpr double kMax = std::numeric_limits<float>::max();
    certain = std::fabs(e.lower) <= kMax && std::fabs(e.upper) <= kMax &&
              static_cast<float>(e.lower) == static_cast<float>(e.upper);
    rounded[k] = certain ? without_sign_of_zero(static_cast<float>(e.lower)) : 0.0f;
  }
  if (certain) return ++counts_.in_double_double, RoundedPoint{point[0].value.hi, rounded[0], rounded[1], rounded[2]};
  ++counts_.in_integers;
  const ExactPoint exact = exact_point(line_, corners);
  return {to_double(exact.t), without_sign_of_zero(round_to_float(exact.t)),
          without_sign_of_zero(round_to_float(exact.u)), without_sign_of_zero(round_to_float(exact.v))};
}

}  // namespace arboretum
