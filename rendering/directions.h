// Directions in which rays leave surfaces: cosine-distributed ones, and the least angle that is safe.
#pragma once

#include <array>

#include "scenes/vec3d.h"

namespace arboretum {

/// A secondary ray leaves its surface at least this steeply (sine to the surface): a direction rounded to
/// float32 must not point back into it.
inline constexpr double kLeastSine = 0x1p-20;

/// The unit direction, turned away from the surface where it is too grazing to leave it for sure. `side`: the normal on
/// the side that the ray is to be on.
[[nodiscard]] inline Vec3f leaving(Vec3d direction, Vec3d side) noexcept {
  direction = normalize(direction);
  const double sine = dot(direction, side);
  if (sine < kLeastSine) direction = normalize(direction + side * (kLeastSine - sine));
  return to_float(direction);
}

/// Cosine and sine of an angle in turns, within [0, 1): as UnitCircle (scenes/vec3d.h) by Taylor's series and with the same bits on every
/// machine, but with factors in place of divisions; error below 2^-50.
struct Turn {
  double cosine, sine;
  explicit Turn(double turns) noexcept {
    const int quarter = int(turns * 4.0 + 0.5);
    const double a = (turns - quarter * 0.25) * 6.283185307179586476925;  // within +-pi/4
    const double a2 = a * a;
    double s = 1.0, c = 1.0;
    for (int k = 8; k >= 1; --k) {
      s = 1.0 - s * (a2 * kFactors[std::size_t(2 * k + 1)]);
      c = 1.0 - c * (a2 * kFactors[std::size_t(2 * k)]);
    }
    s *= a;
    cosine = quarter == 1 ? -s : quarter == 2 ? -c : quarter == 3 ? s : c;
    sine = quarter == 1 ? c : quarter == 2 ? -s : quarter == 3 ? -c : s;
  }

 private:
  /// 1 / (n (n - 1)).
  static constexpr std::array<double, 18> kFactors = [] {
    std::array<double, 18> factors{};
    for (std::size_t n = 2; n < factors.size(); ++n) factors[n] = 1.0 / double(n * (n - 1));
    return factors;
  }();
};

/// Cosine-distributed about +z from a number in [0, 1) and an angle (UnitCircle or Turn); by Malley's method, from the unit disc.
template <class Angle>
[[nodiscard]] Vec3d cosine_direction(double u, const Angle& circle) noexcept {
  const double r = std::sqrt(u);
  return {r * circle.cosine, r * circle.sine, std::sqrt(1.0 - u)};
}

}  // namespace arboretum
