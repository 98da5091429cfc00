// Vec3d: three doubles with nothing but +, -, *, / and sqrt, so that whatever is made of it (generators,
// workloads) has the same bits on every machine. Eigen and libm are kept out for that reason.
#pragma once

#include <array>
#include <cmath>

#include "core/vec3.h"

namespace arboretum {

struct Vec3d {
  double x = 0.0, y = 0.0, z = 0.0;
  Vec3d() = default;
  constexpr Vec3d(double x_, double y_, double z_) noexcept : x(x_), y(y_), z(z_) {}
  explicit Vec3d(Vec3f v) noexcept : x(v.x), y(v.y), z(v.z) {}
};

[[nodiscard]] constexpr Vec3d operator+(Vec3d a, Vec3d b) noexcept { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
[[nodiscard]] constexpr Vec3d operator-(Vec3d a, Vec3d b) noexcept { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
[[nodiscard]] constexpr Vec3d operator*(Vec3d a, double s) noexcept { return {a.x * s, a.y * s, a.z * s}; }
[[nodiscard]] constexpr Vec3d operator*(double s, Vec3d a) noexcept { return a * s; }
[[nodiscard]] constexpr double dot(Vec3d a, Vec3d b) noexcept { return a.x * b.x + a.y * b.y + a.z * b.z; }
[[nodiscard]] constexpr Vec3d cross(Vec3d a, Vec3d b) noexcept {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
[[nodiscard]] inline double length(Vec3d a) noexcept { return std::sqrt(dot(a, a)); }
/// `a` scaled to unit length; a zero vector gives NaN components.
[[nodiscard]] inline Vec3d normalize(Vec3d a) noexcept { return a * (1.0 / length(a)); }
[[nodiscard]] inline Vec3f to_float(Vec3d a) noexcept { return {float(a.x), float(a.y), float(a.z)}; }

/// Two unit vectors that make a right-handed frame with the unit vector `n` (Duff et al., JCGT 6(1), 2017).
struct Frame {
  Vec3d tangent, bitangent, normal;
  explicit Frame(Vec3d n) noexcept : normal(n) {
    const double sign = std::copysign(1.0, n.z);
    const double a = -1.0 / (sign + n.z), b = n.x * n.y * a;
    tangent = {1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x};
    bitangent = {b, sign + n.y * n.y * a, -n.y};
  }
  [[nodiscard]] Vec3d to_world(Vec3d v) const noexcept { return tangent * v.x + bitangent * v.y + normal * v.z; }
};

/// Cosine and sine of an angle given in turns (1 turn = 360 degrees). Exact at quarter turns, bit-identical
/// on every machine (the Taylor series, not libm; factors in place of divisions), error below 2^-52.
struct UnitCircle {
  double cosine, sine;
  explicit UnitCircle(double turns) noexcept {
    const double fraction = turns - std::floor(turns);
    const int quarter = int(fraction * 4.0 + 0.5);
    const double a = (fraction - quarter * 0.25) * 6.283185307179586476925;  // within +-pi/4
    const double a2 = a * a;
    double s = 1.0, c = 1.0;
    for (std::size_t k = 9; k >= 1; --k) {
      s = 1.0 - s * (a2 * kFactors[2 * k + 1]);
      c = 1.0 - c * (a2 * kFactors[2 * k]);
    }
    s *= a;
    switch (quarter & 3) {
      case 0: cosine = c, sine = s; break;
      case 1: cosine = -s, sine = c; break;
      case 2: cosine = -c, sine = -s; break;
      default: cosine = s, sine = -c; break;
    }
  }

 private:
  /// 1 / (n (n - 1)).
  static constexpr std::array<double, 20> kFactors = [] {
    std::array<double, 20> factors{};
    for (std::size_t n = 2; n < factors.size(); ++n) factors[n] = 1.0 / double(n * (n - 1));
    return factors;
  }();
};

}  // namespace arboretum
