// What brute_force says of its builder.
#pragma once

#include <string_view>
#include <type_traits>

#include "structures/brute_force/brute_force.h"

namespace arboretum::brute_force {

[[nodiscard]] inline std::string_view builder_summary(std::type_identity<BruteForce>, std::string_view) {
  return "nothing is sorted: triangles in the mesh's order";
}

}  // namespace arboretum::brute_force
