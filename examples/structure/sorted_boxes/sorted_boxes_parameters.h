// What sorted_boxes says of its builders: one line on its own, the parameters that it has of its own, and which ones a
// build reads. With a binary tree's builder those are that builder's, for it takes the leaves as they are.
#pragma once

#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

#include "sorted_boxes.h"
#include "structures/builders/builder_parameters.h"
#include "structures/parameter_limits.h"

namespace arboretum::sorted_boxes {

[[nodiscard]] inline std::string_view builder_summary(std::type_identity<SortedBoxes>, std::string_view builder) {
  return builder == kMeshOrder ? "blocks of triangles that follow each other in the mesh" : "";
}

inline constexpr Parameter<Parameters> kOwnParameters[] = {
    {.name = "run_length",
     .summary = "triangles of the mesh in a row that share a box, at most",
     .member = &Parameters::run_length,
     .limits = {1, 16}},
};
[[nodiscard]] inline std::span<const Parameter<Parameters>> own_parameters(std::type_identity<SortedBoxes>) {
  return kOwnParameters;
}

[[nodiscard]] inline std::vector<std::string_view> builder_parameters(std::type_identity<SortedBoxes>,
                                                                      std::string_view builder) {
  if (builder == kMeshOrder) return {"run_length"};
  return binary_builder_parameters(builder);
}

}  // namespace arboretum::sorted_boxes
