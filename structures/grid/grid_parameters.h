// What the grid's builders are and read: costs decide which cells get a grid of their own, so `uniform` has no use for
// them.
#pragma once

#include <string_view>
#include <type_traits>
#include <vector>

#include "structures/grid/grid.h"

namespace arboretum::grid {

[[nodiscard]] inline std::vector<std::string_view> builder_parameters(std::type_identity<Grid>,
                                                                      std::string_view builder) {
  std::vector<std::string_view> names{"grid_density"};
  if (builder == "two_level") names.insert(names.end(), {"traversal_cost", "intersection_cost"});
  return names;
}

[[nodiscard]] inline std::string_view builder_summary(std::type_identity<Grid>, std::string_view builder) {
  return builder == "uniform" ? "grid: one, of equal cells" : "grid: crowded cells are divided by a grid of their own";
}

}  // namespace arboretum::grid
