// How large coordinates are, and whether a mesh may hold them.
#pragma once

#include <algorithm>
#include <cmath>

#include "core/bounds.h"
#include "core/mesh.h"

namespace arboretum {

/// The largest |coordinate|; of NaN components it says nothing.
[[nodiscard]] inline float largest_coordinate(Vec3f p) noexcept {
  return std::max({std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)});
}

/// The largest |coordinate| of the box's corners; 0 for an empty box.
[[nodiscard]] inline float largest_coordinate(const Bounds3f& box) noexcept {
  return box.empty() ? 0.0f : std::max(largest_coordinate(box.lower), largest_coordinate(box.upper));
}

/// Whether a mesh may hold the point: finite, and no coordinate beyond kMaxCoordinate.
[[nodiscard]] inline bool is_in_range(Vec3f p) noexcept {
  return std::fabs(p.x) <= kMaxCoordinate && std::fabs(p.y) <= kMaxCoordinate && std::fabs(p.z) <= kMaxCoordinate;
}

}  // namespace arboretum
