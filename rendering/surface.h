// Surface: a material made ready for shading, with the lobes that the effects leave it.
//
// Diffuse: Lambert. Mirror: Ks, perfect; with Schlick's Fresnel, F0 = Ks, of illum 5. Glossy: GGX with Schlick's
// Fresnel, F0 = Ks, alpha = Pr^2, or sqrt(2 / (Ns + 2)) without a Pr. Dielectric: smooth glass, Fresnel's equations, Ks
// and Tf as filters of what it reflects and lets through. Beside a specular lobe Kd is lowered to 1 - Ks where it is
// more, so that no surface gives back more light than it gets.
#pragma once

#include "core/vec3.h"
#include "rendering/effect_set.h"
#include "rendering/luminance.h"
#include "scenes/material_kind.h"

namespace arboretum {

enum class SpecularLobe : unsigned char { none, mirror, glossy, dielectric };

struct Surface {
  Vec3f diffuse{}, specular{}, transmission{}, emission{};  ///< light is emitted on both sides
  SpecularLobe lobe = SpecularLobe::none;
  bool fresnel = false;  ///< of a mirror: it reflects by Schlick's approximation, and what is below lies under a coat
  double alpha = 1.0;    ///< of GGX
  double ior = 1.0;      ///< of what is behind the side that sees the corners counter-clockwise
  float opacity = 1.0f;
  int diffuse_map = -1, opacity_map = -1;  ///< numbers of textures, or -1

  /// Lets rays through somewhere.
  [[nodiscard]] bool has_holes() const noexcept { return opacity < 1.0f || opacity_map >= 0; }
};

/// Without maps: those are the scene's.
[[nodiscard]] Surface make_surface(const Material& material, EffectSet effects);

/// alpha is not below this: a narrower lobe cannot be told from a mirror, and its density overflows.
inline constexpr double kLeastAlpha = 0x1p-9;

}  // namespace arboretum
