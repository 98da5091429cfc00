// Bounds of the part of a triangle that lies in a box ("perfect splits": Havran 2000, section 4.4; Wald and Havran
// 2006, section 3.2).
#pragma once

#include <array>

#include "core/bounds.h"

namespace arboretum::kdtree {

/// The triangle is clipped in double against the closed box, its bounds are rounded outward to float and cut to the
/// box. An empty result means that the triangle does not come nearer to the box than double rounding can tell.
[[nodiscard]] Bounds3f clipped_bounds(const std::array<Vec3f, 3>& corners, const Bounds3f& box) noexcept;

/// The same for the two halves of the box at `plane`, which lies within it: clipped once, then parted.
void clipped_bounds(const std::array<Vec3f, 3>& corners, const Bounds3f& box, int axis, float plane, Bounds3f& left,
                    Bounds3f& right) noexcept;

}  // namespace arboretum::kdtree
