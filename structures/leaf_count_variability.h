// Leaf-count variability of a hierarchy of boxes (Aila, Karras, Laine, "On Quality Metrics of Bounding Volume
// Hierarchies", HPG 2013): how unequal the work of rays is, which SAH, a mean, does not say.
#pragma once

#include <cstddef>
#include <span>

#include "structures/end_point_overlap.h"

namespace arboretum {

/// Of random lines that meet the root's box: how many leaves' boxes each meets.
struct LeafCounts {
  double mean = 0.0;       ///< expected: the sum of the leaves' areas over the root's
  double deviation = 0.0;  ///< standard deviation: the leaf-count variability
  std::size_t lines = 0;
};

/// Lines are whole (no hit ends them) and distributed as SAH takes them: isotropic and uniform over those that meet the
/// root's box, made as a uniform point of the box's surface and a cosine-distributed direction from there. Up to 4096
/// of a fixed seed, fewer where `work` box tests are spent before. A root without area gives {leaves, 0, 0}.
[[nodiscard]] LeafCounts leaf_counts(std::span<const TreeRecord> records, double work = 1e8);

}  // namespace arboretum
