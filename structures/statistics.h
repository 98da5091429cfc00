// Statistics of a structure, computed once for all structures from what Accel::visit shows.
#pragma once

#include <cstddef>
#include <vector>

#include "structures/accel.h"

namespace arboretum {

struct StructureStatistics {
  bool available = false;  ///< false where the structure cannot be looked into; then all but bytes is 0
  /// Surface area heuristic: sum of (area / root area) * cost. A node costs traversal_cost, a leaf
  /// intersection_cost a block. Where the root has no area every node counts as reached.
  double sah_cost = 0.0;
  double sah_child_cost = 0.0;  ///< the same, but a node costs traversal_cost a child box
  /// End-point overlap with the same costs (Aila, Karras, Laine, "On Quality Metrics of Bounding Volume
  /// Hierarchies", HPG 2013): sum over nodes and leaves of cost * (area of the triangle parts inside the box
  /// that are not of its subtree) / (area of all triangles).
  double epo = 0.0;
  double epo_sampled = 0.0;  ///< share of the nodes and leaves that went into epo: 1 is all, less an estimate
  /// Leaf-count variability: the standard deviation of the number of leaf boxes that a random line through the root's
  /// box meets (leaf_count_variability.h), and the mean of that number; `lcv_lines` lines were drawn.
  double lcv = 0.0, leaves_per_line = 0.0;
  std::size_t lcv_lines = 0;
  std::size_t nodes = 0, leaves = 0, references = 0, blocks = 0;
  unsigned depth = 0;                                     ///< of the deepest leaf; a root that is a leaf has 0
  std::size_t bytes = 0, node_bytes = 0, leaf_bytes = 0;  ///< what is neither node nor leaf is bytes less the two
  double leaf_fill = 0.0;                                 ///< references / (blocks * block width)
  double duplication = 0.0;  ///< references / triangles of the mesh: above 1 where leaves share triangles
  double children_per_node = 0.0;
  std::vector<std::size_t> depth_histogram;  ///< leaves at each depth
  std::vector<std::size_t> leaf_histogram;   ///< leaves with 0, 1, ... triangles; the last, [32], has all with more too
};

/// SAH with the given costs. EPO takes about n log n time on ordinary scenes and up to n^2 where most boxes
/// overlap; beyond a fixed amount of work it is estimated from the 64 largest boxes and an even sample of the
/// others (epo_sampled < 1), the same on every run. EPO and LCV are left 0 when `slow_ones` is false.
[[nodiscard]] StructureStatistics compute_statistics(const Accel& accel, const TriangleMesh& mesh,
                                                     const BuilderParameters& costs, bool slow_ones);

}  // namespace arboretum
