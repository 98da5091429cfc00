// EffectSet: the effects that a renderer simulates, a bit each. What is not in the set costs nothing: no rays, no
// random numbers, no tables.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "scenes/effects.h"

namespace arboretum {

/// In the order of kEffectNames.
enum class EffectKind : unsigned char {
  shadow_hard,   ///< point, spot and directional lights, and shadow rays to them
  shadow_soft,   ///< light from emissive triangles, sampled as areas
  env_light,     ///< radiance of the environment
  mirror,        ///< perfect reflection
  glossy,        ///< rough specular lobes
  dielectric,    ///< glass
  diffuse_gi,    ///< light that diffuse surfaces hand on
  dof,           ///< a lens with an aperture
  motion_blur,   ///< a time for each ray
  alpha_cutout,  ///< hits that may be passed through
  instancing,    ///< instances kept for a structure of two levels
  texture,       ///< diffuse maps
  multi_light    ///< choosing among emitters
};

class EffectSet {
 public:
  constexpr EffectSet() = default;
  [[nodiscard]] static constexpr EffectSet all() noexcept { return EffectSet((1u << kEffectNames.size()) - 1u); }

  [[nodiscard]] constexpr bool has(EffectKind kind) const noexcept { return (bits_ >> unsigned(kind) & 1u) != 0; }
  [[nodiscard]] constexpr EffectSet with(EffectKind kind) const noexcept {
    return EffectSet(bits_ | 1u << unsigned(kind));
  }
  [[nodiscard]] constexpr EffectSet without(EffectKind kind) const noexcept {
    return EffectSet(bits_ & ~(1u << unsigned(kind)));
  }
  [[nodiscard]] constexpr bool empty() const noexcept { return bits_ == 0; }
  friend constexpr bool operator==(const EffectSet&, const EffectSet&) = default;

 private:
  constexpr explicit EffectSet(std::uint32_t bits) noexcept : bits_(bits) {}
  std::uint32_t bits_ = 0;
};

[[nodiscard]] constexpr std::string_view to_string(EffectKind kind) noexcept { return kEffectNames[std::size_t(kind)]; }
/// Something in the scene gives light.
[[nodiscard]] constexpr bool is_lit(EffectSet effects) noexcept {
  return effects.has(EffectKind::shadow_hard) || effects.has(EffectKind::shadow_soft) ||
         effects.has(EffectKind::env_light);
}
/// Those that are called for.
[[nodiscard]] EffectSet called_for(const std::vector<Effect>& effects);
/// `auto`: what is called for; `all`; or names with commas between them, those alone; blanks around them are none of
/// the names'. Throws UserError, naming the nearest.
[[nodiscard]] EffectSet parse_effects(const std::string& words, EffectSet called_for);

}  // namespace arboretum
