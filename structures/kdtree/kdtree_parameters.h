// What the kd-tree's builders read.
#pragma once

#include <string_view>
#include <type_traits>
#include <vector>

#include "structures/kdtree/kdtree.h"

namespace arboretum::kdtree {

[[nodiscard]] inline std::vector<std::string_view> builder_parameters(std::type_identity<KdTree>,
                                                                      std::string_view builder) {
  std::vector<std::string_view> names{"traversal_cost", "intersection_cost", "max_leaf_blocks", "empty_bonus",
                                      "max_depth"};
  if (builder == "binned_sah") names.push_back("bins");
  return names;
}

}  // namespace arboretum::kdtree
