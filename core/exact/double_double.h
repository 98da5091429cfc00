// DoubleDouble: an unevaluated sum of two doubles, about 106 bits, for the middle level of the exact
// predicate.
//
// Error bounds: Joldes, Muller, Popescu, "Tight and rigorous error bounds for basic building blocks of
// double-word arithmetic", ACM TOMS 44(2), 2017. Each operation below has a relative error under 10 * 2^-106.
// They need round-to-nearest, no contraction and no underflow of the low parts; the predicate's operands see
// to the last one.
#pragma once

#include <cmath>

namespace arboretum {

struct DoubleDouble {
  double hi = 0.0, lo = 0.0;
};

/// hi + lo == a + b exactly (Knuth).
[[nodiscard]] inline DoubleDouble two_sum(double a, double b) noexcept {
  const double s = a + b, bb = s - a;
  return {s, (a - (s - bb)) + (b - bb)};
}

/// The same for |a| >= |b| or a == 0 (Dekker).
[[nodiscard]] inline DoubleDouble fast_two_sum(double a, double b) noexcept {
  const double s = a + b;
  return {s, b - (s - a)};
}

/// hi + lo == a * b exactly (Dekker and Veltkamp; no FMA, which the baseline instruction set lacks).
[[nodiscard]] inline DoubleDouble two_product(double a, double b) noexcept {
  constexpr double kSplit = 134217729.0;  // 2^27 + 1
  const double p = a * b;
  const double ca = kSplit * a, ah = ca - (ca - a), al = a - ah;
  const double cb = kSplit * b, bh = cb - (cb - b), bl = b - bh;
  return {p, ((ah * bh - p) + ah * bl + al * bh) + al * bl};
}

[[nodiscard]] inline DoubleDouble operator-(DoubleDouble a) noexcept { return {-a.hi, -a.lo}; }

[[nodiscard]] inline DoubleDouble operator+(DoubleDouble a, DoubleDouble b) noexcept {
  const DoubleDouble s = two_sum(a.hi, b.hi), t = two_sum(a.lo, b.lo);
  const DoubleDouble v = fast_two_sum(s.hi, s.lo + t.hi);
  return fast_two_sum(v.hi, t.lo + v.lo);
}
[[nodiscard]] inline DoubleDouble operator-(DoubleDouble a, DoubleDouble b) noexcept { return a + -b; }

[[nodiscard]] inline DoubleDouble operator*(DoubleDouble a, DoubleDouble b) noexcept {
  const DoubleDouble p = two_product(a.hi, b.hi);
  return fast_two_sum(p.hi, p.lo + (a.hi * b.lo + a.lo * b.hi));
}

/// Quotient with a relative error under 2^-98 (one correction step on the rounded quotient).
[[nodiscard]] inline DoubleDouble operator/(DoubleDouble a, DoubleDouble b) noexcept {
  const double q = a.hi / b.hi;
  const DoubleDouble r = a - DoubleDouble{q, 0.0} * b;
  return fast_two_sum(q, r.hi / b.hi);
}

}  // namespace arboretum
