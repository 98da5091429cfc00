// End-point overlap of a hierarchy of boxes (Aila, Karras, Laine 2013), as statistics.h defines it.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/mesh.h"

namespace arboretum {

/// A node or leaf of a hierarchy laid out parents first: its subtree is the records up to `end`.
struct TreeRecord {
  Bounds3f bounds;
  double cost = 0.0;
  std::uint32_t end = 0;
  std::uint32_t first_reference = 0, end_reference = 0;  ///< of all leaves of the subtree
  bool is_leaf = false;
};

struct EndPointOverlap {
  double value = 0.0;
  double sampled = 1.0;  ///< share of the records that were looked at
};

/// `references` are the primitives of all leaves, in the records' order. `work` bounds the number of box
/// steps and clips.
[[nodiscard]] EndPointOverlap end_point_overlap(const TriangleMesh& mesh, std::span<const TreeRecord> records,
                                                std::span<const std::uint32_t> references, double work = 4e8);

/// Area of the part of a triangle that lies in the closed box.
[[nodiscard]] double clipped_area(const std::array<Vec3f, 3>& corners, const Bounds3f& box);

}  // namespace arboretum
