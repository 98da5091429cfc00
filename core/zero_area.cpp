#include "core/zero_area.h"

#include <cstddef>

namespace arboretum {
namespace {

/// Whether the doubles sum to zero exactly: they are gathered into a non-overlapping expansion (Shewchuk
/// 1997, GROW-EXPANSION), which is zero only when each of its components is.
template <std::size_t N>
bool sums_to_zero(const double (&terms)[N]) noexcept {
  double expansion[N] = {};
  for (std::size_t n = 0; n < N; ++n) {
    double carry = terms[n];
    for (std::size_t i = 0; i < n; ++i) {
      const double sum = carry + expansion[i];
      const double virtual_part = sum - carry;
      const double error = (carry - (sum - virtual_part)) + (expansion[i] - virtual_part);
      expansion[i] = error, carry = sum;
    }
    expansion[n] = carry;
  }
  for (const double component : expansion)
    if (component != 0.0) return false;
  return true;
}

/// Whether three points of the plane, float32 numbers in doubles, are exactly collinear. Products of two
/// floats are exact in double (48 bits, no underflow), so the determinant is an exact sum of six doubles.
bool collinear(double ax, double ay, double bx, double by, double cx, double cy) noexcept {
  if (clearly_not_collinear(ax, ay, bx, by, cx, cy)) return false;
  return sums_to_zero({ax * by, -ay * bx, bx * cy, -by * cx, cx * ay, -cy * ax});
}

}  // namespace

bool is_exactly_flat(Vec3f a, Vec3f b, Vec3f c) noexcept {
  // Walls have no area in a projection or two: the cheap answer of another before exact sums.
  if (clearly_not_collinear(a.y, a.z, b.y, b.z, c.y, c.z) || clearly_not_collinear(a.z, a.x, b.z, b.x, c.z, c.x))
    return false;
  return collinear(a.x, a.y, b.x, b.y, c.x, c.y) && collinear(a.y, a.z, b.y, b.z, c.y, c.z) &&
         collinear(a.z, a.x, b.z, b.x, c.z, c.x);
}

}  // namespace arboretum
