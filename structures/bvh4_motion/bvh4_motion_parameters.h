// What the builders of bvh4_motion read: its tree is bvh4's.
#pragma once

#include <string_view>
#include <type_traits>
#include <vector>

#include "structures/bvh/bvh_parameters.h"
#include "structures/bvh4_motion/bvh4_motion.h"

namespace arboretum::bvh4_motion {

[[nodiscard]] inline std::vector<std::string_view> builder_parameters(std::type_identity<Bvh4Motion>,
                                                                      std::string_view builder) {
  return builder_parameters(std::type_identity<bvh::Bvh4>{}, builder);
}

}  // namespace arboretum::bvh4_motion
