// What sorted_boxes reads of BuilderParameters: what the builder of its binary tree does. It takes the leaves as they
// are.
#pragma once

#include <string_view>
#include <type_traits>
#include <vector>

#include "sorted_boxes.h"
#include "structures/builders/builder_parameters.h"

namespace arboretum::sorted_boxes {

[[nodiscard]] inline std::vector<std::string_view> builder_parameters(std::type_identity<SortedBoxes>,
                                                                      std::string_view builder) {
  return binary_builder_parameters(builder);
}

}  // namespace arboretum::sorted_boxes
