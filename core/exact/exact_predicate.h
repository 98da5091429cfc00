// ExactPredicate: whether a ray meets a triangle, and where, decided exactly on float32 inputs of any finite
// size.
//
// Three levels (the scheme of Shewchuk's adaptive predicates, 1997): doubles with a proved error bound,
// double-doubles with a proved error bound, whole numbers. A level decides only what its bound allows; the
// last decides everything. E_ij = det[p_i - o, p_j - o, d]; the line meets the closed triangle where the
// three are all >= 0 or all <= 0 and their sum N.d is not 0; t = N.(a - o) / N.d with N = (b - a) x (c - a).
#pragma once

#include <array>
#include <cstdint>

#include "core/ray.h"
#include "core/exact/determinant.h"
#include "core/exact/double_double.h"
#include "core/exact/exact_integer.h"

namespace arboretum {

/// How many decisions (a sign, an interval end, an order) each level took.
struct DecisionCounts {
  std::uint64_t in_double = 0, in_double_double = 0, in_integers = 0;
  DecisionCounts& operator+=(const DecisionCounts& other) noexcept {
    in_double += other.in_double, in_double_double += other.in_double_double, in_integers += other.in_integers;
    return *this;
  }
};

/// lower <= exact value <= upper.
struct Enclosure {
  double lower = 0.0, upper = 0.0;
};

/// The exact point where a ray meets a triangle, rounded: t to a relative error of at most 2^-50 and
/// correctly to float32; u and v, the weights of the second and third corner, correctly to float32.
struct RoundedPoint {
  double t = 0.0;
  float t_rounded = 0.0f, u = 0.0f, v = 0.0f;
};

/// Decides for one valid ray. Not thread-safe: counts as it goes.
class ExactPredicate {
 public:
  /// `ray` must be valid (core/ray.h).
  explicit ExactPredicate(const Ray& ray) noexcept;
  /// The same ray from another origin, which may have more digits than float32 has (ExactLine).
  ExactPredicate(const Ray& ray, const std::array<double, 3>& origin) noexcept;

  /// Whether the ray meets the closed triangle at a t within the closed interval; then `t` encloses it. The
  /// corners must be finite.
  [[nodiscard]] bool meets(const Corners& corners, Enclosure& t);
  /// Sign of t(first) - t(second). Both must be met by the ray's line.
  [[nodiscard]] int compare_t(const Corners& first, const Corners& second);
  /// For a triangle that the ray's line meets.
  [[nodiscard]] RoundedPoint round(const Corners& corners);

  [[nodiscard]] const DecisionCounts& counts() const noexcept { return counts_; }

 private:
  struct Approximate;
  [[nodiscard]] int edge_sign_in_double_double(const Triple<DoubleDouble>& p, const Triple<DoubleDouble>& q,
                                               double scale, bool& certain) const;
  [[nodiscard]] Approximate approximate_t(const Corners& corners) const;
  /// Whether the ray's line passes through the point; false also where doubles cannot hold the point as seen from the
  /// origin.
  [[nodiscard]] bool surely_on_line(Vec3f point) const;
  [[nodiscard]] bool within_interval(const Corners& corners, Enclosure& t);

  ExactLine line_;
  Triple<double> origin_, direction_;
  double tnear_, tfar_;
  double direction_size_;  ///< largest |component|
  DecisionCounts counts_;
};

}  // namespace arboretum
