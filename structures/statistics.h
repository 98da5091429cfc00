// Statistics of a structure, computed once for all structures from what Accel::visit shows.
#pragma once

#include <cstddef>
#include <vector>

#include "structures/accel.h"

namespace arboretum {

struct StructureStatistics {
  bool available = false;      ///< false where the structure cannot be looked into
  double sah_cost = 0.0;       ///< surface area heuristic: sum over nodes and leaves of (area / root area) * cost
  double sah_child_cost = 0.0; ///< the same with one unit of cost a child box
  double epo = 0.0;            ///< end-point overlap (Aila, Karras, Laine 2013)
  std::size_t nodes = 0, leaves = 0, references = 0, blocks = 0;
  unsigned depth = 0;          ///< of the deepest leaf; a root that is a leaf has 0
  std::size_t bytes = 0, node_bytes = 0, leaf_bytes = 0;
  double leaf_fill = 0.0;      ///< references / (blocks * block width)
  double duplication = 1.0;    ///< references / primitives
  double children_per_node = 0.0;
  std::vector<std::size_t> depth_histogram;  ///< leaves at each depth
};

/// SAH with the given costs. EPO takes O(n log n) time and is left 0 when `with_epo` is false.
[[nodiscard]] StructureStatistics compute_statistics(const Accel& accel, const TriangleMesh& mesh,
                                                     const BuilderParameters& costs, bool with_epo);

}  // namespace arboretum
