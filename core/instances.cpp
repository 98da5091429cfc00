#include "core/instances.h"

#include <cmath>
#include <limits>

namespace arboretum {
namespace {

/// The determinant of two rows and two columns of the linear part.
double minor(const AffineMap& map, int r0, int r1, int c0, int c1) noexcept {
  const auto& m = map.m;
  return m[r0][c0] * m[r1][c1] - m[r0][c1] * m[r1][c0];
}

}  // namespace

Vec3f transform_point(const AffineMap& map, Vec3f p) noexcept {
  const auto row = [&](const double(&r)[4]) { return float(((r[0] * p.x + r[1] * p.y) + r[2] * p.z) + r[3]); };
  return {row(map.m[0]), row(map.m[1]), row(map.m[2])};
}

Vec3f transform_direction(const AffineMap& map, Vec3f d) noexcept {
  const auto row = [&](const double(&r)[4]) { return float((r[0] * d.x + r[1] * d.y) + r[2] * d.z); };
  return {row(map.m[0]), row(map.m[1]), row(map.m[2])};
}

double determinant(const AffineMap& map) noexcept {
  const auto& m = map.m;
  return m[0][0] * minor(map, 1, 2, 1, 2) - m[0][1] * minor(map, 1, 2, 0, 2) + m[0][2] * minor(map, 1, 2, 0, 1);
}

AffineMap inverse(const AffineMap& map) noexcept {
  const auto& m = map.m;
  const double d = determinant(map);
  AffineMap r;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const int r0 = j == 0 ? 1 : 0, r1 = j == 2 ? 1 : 2, c0 = i == 0 ? 1 : 0, c1 = i == 2 ? 1 : 2;
      r.m[i][j] = ((i + j) % 2 == 0 ? 1.0 : -1.0) * minor(map, r0, r1, c0, c1) / d;
    }
  }
  for (auto& row : r.m) row[3] = -((row[0] * m[0][3] + row[1] * m[1][3]) + row[2] * m[2][3]);
  return r;
}

double condition(const AffineMap& map) noexcept {
  const AffineMap back = inverse(map);
  double largest = 0.0;
  for (int i = 0; i < 3; ++i) {
    double sum = 0.0;
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 3; ++k) sum += std::fabs(map.m[i][k]) * std::fabs(back.m[k][j]);
    }
    if (!(sum <= largest)) largest = sum;
  }
  return std::isfinite(largest) ? largest : std::numeric_limits<double>::infinity();
}

}  // namespace arboretum
