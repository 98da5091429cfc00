// What the bounding interval hierarchy's builders read.
#pragma once

#include <string_view>
#include <type_traits>
#include <vector>

#include "structures/bih/bih.h"
#include "structures/builders/builder_parameters.h"

namespace arboretum::bih {

[[nodiscard]] inline std::vector<std::string_view> builder_parameters(std::type_identity<Bih>,
                                                                      std::string_view builder) {
  std::vector<std::string_view> names = binary_builder_parameters(builder);
  names.insert(names.end(), {"traversal_cost", "intersection_cost", "max_leaf_blocks"});
  return names;
}

}  // namespace arboretum::bih
