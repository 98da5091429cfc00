// The last level of the exact predicate: integer arithmetic on float32 inputs scaled to whole numbers.
#pragma once

#include <array>

#include <boost/multiprecision/cpp_int.hpp>

#include "core/ray.h"

namespace arboretum {

/// Fixed-size signed integer, no allocation. The largest value needed has degree 6 in numbers of 278 bits
/// (float32's whole range as multiples of 2^-149, one bit for the difference), which with the carries stays
/// under 1700 bits.
using ExactInteger = boost::multiprecision::number<
    boost::multiprecision::cpp_int_backend<2048, 2048, boost::multiprecision::signed_magnitude,
                                           boost::multiprecision::unchecked, void>,
    boost::multiprecision::et_off>;

using Corners = std::array<Vec3f, 3>;

/// numerator / denominator * 2^exponent, with denominator > 0.
struct ExactFraction {
  ExactInteger numerator, denominator;
  int exponent = 0;
};

/// Sign of a - x for a finite x.
[[nodiscard]] int compare(const ExactFraction& a, double x);
/// Within one unit in the last place of the exact value. |value| must be within 2^-1000 .. 2^1000, or 0.
[[nodiscard]] double to_double(const ExactFraction& a);
/// Correctly rounded, ties to even; infinity beyond the float32 range.
[[nodiscard]] float round_to_float(const ExactFraction& a);

/// The line that a ray lies on. The origin may have more digits than float32 has, but is on its grid: a multiple of
/// 2^-149 below 2^128.
struct ExactLine {
  std::array<double, 3> origin;
  Vec3f direction;
};

/// Signs of E_ab, E_bc, E_ca, where E_ij = det[p_i - o, p_j - o, d].
[[nodiscard]] std::array<int, 3> exact_edge_signs(const ExactLine& line, const Corners& corners);

/// Sign of t(first) - t(second). The line must be parallel to neither triangle's plane.
[[nodiscard]] int compare_exact_t(const ExactLine& line, const Corners& first, const Corners& second);

/// t alone. The line must not be parallel to the triangle's plane.
[[nodiscard]] ExactFraction exact_t(const ExactLine& line, const Corners& corners);

/// t and the weights of the second and third corner, under the same condition.
struct ExactPoint {
  ExactFraction t, u, v;
};
[[nodiscard]] ExactPoint exact_point(const ExactLine& line, const Corners& corners);

}  // namespace arboretum
