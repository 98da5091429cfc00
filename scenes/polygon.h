// Polygons to triangles: ear clipping in the plane of the polygon's own normal, no vertex added.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/mesh.h"

namespace arboretum {

/// Appends the n - 2 triangles of a polygon of n >= 3 corners (indices into `vertices`) to `triangles`. A
/// polygon that is not simple, has no area, or is concave with more than 1024 corners, still gives n - 2
/// triangles over its corners. Returns how often a corner was tested against a triangle that might be cut off: at most
/// 4 n^2.
std::size_t triangulate(std::span<const std::uint32_t> corners, std::span<const Vec3f> vertices,
                        std::vector<Triangle>& triangles);

}  // namespace arboretum
