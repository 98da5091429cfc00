// Effects: which optical effects a scene calls for, and why. A pure function of the scene; a renderer
// simulates these alone.
#pragma once

#include <array>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/scene.h"

namespace arboretum {

inline constexpr std::array<std::string_view, 13> kEffectNames{
    "shadow_hard", "shadow_soft", "env_light",    "mirror",     "glossy",  "dielectric", "diffuse_gi",
    "dof",         "motion_blur", "alpha_cutout", "instancing", "texture", "multi_light"};

struct Effect {
  std::string_view name;
  bool called_for = false;
  std::string reason;  ///< one line, either way
};

/// All effects, in the order of kEffectNames. Only materials that a triangle uses count. Looks into the
/// images that materials name, since a map of one value calls for nothing.
[[nodiscard]] std::vector<Effect> effects_of(const Scene& scene);

}  // namespace arboretum
