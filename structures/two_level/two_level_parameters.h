// What the top of two_level reads; what is below reads its own (parameters_read.h adds it).
#pragma once

#include <algorithm>
#include <string_view>
#include <type_traits>
#include <vector>

#include "structures/builders/builders.h"
#include "structures/bvh/bvh_parameters.h"
#include "structures/two_level/two_level.h"

namespace arboretum::two_level {

[[nodiscard]] inline std::vector<std::string_view> builder_parameters(std::type_identity<TwoLevel>,
                                                                      std::string_view builder) {
  // The top is a bvh4 with one block a leaf, by the same builder where that makes binary trees.
  const auto& binary = binary_builder_names();
  std::vector<std::string_view> names = builder_parameters(
      std::type_identity<bvh::Bvh4>{}, std::ranges::find(binary, builder) == binary.end() ? binary.front() : builder);
  std::erase(names, "max_leaf_blocks");
  names.push_back("below");
  return names;
}

}  // namespace arboretum::two_level
