// What the octree's builder is and reads.
#pragma once

#include <string_view>
#include <type_traits>
#include <vector>

#include "structures/octree/octree.h"

namespace arboretum::octree {

[[nodiscard]] inline std::vector<std::string_view> builder_parameters(std::type_identity<Octree>, std::string_view) {
  return {"traversal_cost", "intersection_cost", "max_depth"};
}

[[nodiscard]] inline std::string_view builder_summary(std::type_identity<Octree>, std::string_view) {
  return "octree: cells divided in eight while that is estimated to pay";
}

}  // namespace arboretum::octree
