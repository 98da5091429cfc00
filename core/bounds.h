// Bounds3f: a closed axis-aligned box; empty when lower > upper on any axis.
#pragma once

#include <limits>

#include "core/vec3.h"

namespace arboretum {

struct Bounds3f {
  static constexpr float kInfinity = std::numeric_limits<float>::infinity();
  Vec3f lower{kInfinity, kInfinity, kInfinity};
  Vec3f upper{-kInfinity, -kInfinity, -kInfinity};

  void extend(Vec3f p) noexcept { lower = min(lower, p), upper = max(upper, p); }
  void extend(const Bounds3f& b) noexcept { lower = min(lower, b.lower), upper = max(upper, b.upper); }
  [[nodiscard]] bool empty() const noexcept {
    return !(lower.x <= upper.x && lower.y <= upper.y && lower.z <= upper.z);
  }
  [[nodiscard]] bool contains(const Bounds3f& b) const noexcept {
    return lower.x <= b.lower.x && lower.y <= b.lower.y && lower.z <= b.lower.z && upper.x >= b.upper.x &&
           upper.y >= b.upper.y && upper.z >= b.upper.z;
  }
  [[nodiscard]] Vec3f extent() const noexcept { return upper - lower; }
  [[nodiscard]] Vec3f center() const noexcept { return lower * 0.5f + upper * 0.5f; }
  /// Surface area; 0 for an empty box.
  [[nodiscard]] double area() const noexcept {
    if (empty()) return 0.0;
    const double dx = double(upper.x) - lower.x, dy = double(upper.y) - lower.y, dz = double(upper.z) - lower.z;
    return 2.0 * (dx * dy + dy * dz + dz * dx);
  }
  friend bool operator==(const Bounds3f&, const Bounds3f&) = default;
};

}  // namespace arboretum
