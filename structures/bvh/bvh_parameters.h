// What the builders of wide BVHs read, whatever their nodes are (bvh4_aos and bvh_quantised included).
#pragma once

#include <string_view>
#include <type_traits>
#include <vector>

#include "structures/builders/builder_parameters.h"
#include "structures/bvh/bvh.h"

namespace arboretum::bvh {

template <class Format>
[[nodiscard]] std::vector<std::string_view> builder_parameters(std::type_identity<WideBvh<Format>>,
                                                               std::string_view builder) {
  std::vector<std::string_view> names = binary_builder_parameters(builder);
  names.insert(names.end(), {"traversal_cost", "intersection_cost", "max_leaf_blocks", "collapse"});
  return names;
}

}  // namespace arboretum::bvh
