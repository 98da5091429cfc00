#include "structures/builders/clip.h"

#include <algorithm>
#include <cmath>

#include "core/rounding.h"

namespace arboretum {
namespace {

/// Adds the point where the edge from a to b passes p[axis] = plane, which lies strictly between the two.
void extend_by_crossing(Bounds3f& box, Vec3f a, Vec3f b, int axis, float plane) noexcept {
  const double s = (double(plane) - a[axis]) / (double(b[axis]) - a[axis]);
  for (int other : {(axis + 1) % 3, (axis + 2) % 3}) {
    const double from = a[other], to = b[other], at = from + s * (to - from);
    // s is right to three roundings, `at` to a few more: 2^-53 * 8 of the larger end bounds them all.
    const double error = std::max(std::fabs(from), std::fabs(to)) * 0x1p-50;
    const float low = float(at - error), high = float(at + error);
    // No further than the edge's own ends, which are exact.
    const float least = std::max(next_below(low), std::min(a[other], b[other]));
    const float most = std::min(next_above(high), std::max(a[other], b[other]));
    box.lower[other] = std::min(box.lower[other], least);
    box.upper[other] = std::max(box.upper[other], most);
  }
}

}  // namespace

Bounds3f clip_to_slab(const std::array<Vec3f, 3>& corners, int axis, float lower, float upper) noexcept {
  Bounds3f box;
  float least = Bounds3f::kInfinity, most = -Bounds3f::kInfinity;
  for (int i = 0; i < 3; ++i) {
    const Vec3f a = corners[std::size_t(i)], b = corners[std::size_t((i + 1) % 3)];
    least = std::min(least, a[axis]), most = std::max(most, a[axis]);
    if (a[axis] >= lower && a[axis] <= upper) box.extend(a);
    for (float plane : {lower, upper}) {
      if (std::min(a[axis], b[axis]) < plane && plane < std::max(a[axis], b[axis]))
        extend_by_crossing(box, a, b, axis, plane);
    }
  }
  box.lower[axis] = std::max(least, lower), box.upper[axis] = std::min(most, upper);
  return box;
}

void clip_by_plane(const std::array<Vec3f, 3>& corners, int axis, float plane, Bounds3f& low, Bounds3f& high) noexcept {
  Bounds3f cut;
  low = high = {};
  for (int i = 0; i < 3; ++i) {
    const Vec3f a = corners[std::size_t(i)], b = corners[std::size_t((i + 1) % 3)];
    if (a[axis] <= plane) low.extend(a);
    if (a[axis] >= plane) high.extend(a);
    if (std::min(a[axis], b[axis]) < plane && plane < std::max(a[axis], b[axis]))
      extend_by_crossing(cut, a, b, axis, plane);
  }
  if (low.empty() || high.empty()) return;
  // A cut has no extent along the axis but where it lies.
  cut.lower[axis] = cut.upper[axis] = plane;
  low.extend(cut), high.extend(cut);
}

}  // namespace arboretum
