// What a material's surface does with light, read from its MTL entry: one definition for the effects that a scene calls
// for and for the renderer that simulates them.
#pragma once

#include "scenes/scene.h"

namespace arboretum {

[[nodiscard]] inline bool is_bright(Vec3f c) noexcept { return c.x > 0.0f || c.y > 0.0f || c.z > 0.0f; }

/// Lets light through by its illumination model: illum 4, 6, 7 and 9, a filter Tf that is not black. The format's 5 is
/// reflection alone, but files have it for glass too: those that give a Ni or a coloured Tf.
[[nodiscard]] inline bool is_transparent(const Material& m) noexcept {
  const bool says_glass = m.ior != 1.0f || m.transmission != Vec3f{1, 1, 1};
  return (m.illum == 4 || (m.illum == 5 && says_glass) || m.illum == 6 || m.illum == 7 || m.illum == 9) &&
         is_bright(m.transmission);
}
/// Refracts, or filters: glass of Ni 1 bends nothing and reflects nothing, but may have a colour.
[[nodiscard]] inline bool is_dielectric(const Material& m) noexcept {
  return is_transparent(m) && (m.ior != 1.0f || m.transmission != Vec3f{1, 1, 1});
}
/// Glass of Ni 1 without a colour cannot be seen: the same as nothing. With a d between 0 and 1 it is a cut-out.
[[nodiscard]] inline bool is_invisible(const Material& m) noexcept {
  return is_transparent(m) && !is_dielectric(m) && (m.opacity <= 0.0f || m.opacity >= 1.0f) && m.opacity_map.empty() &&
         !is_bright(m.emission);
}
[[nodiscard]] inline bool is_mirror(const Material& m) noexcept {
  return !is_dielectric(m) && !is_invisible(m) && (m.illum == 3 || m.illum == 5 || m.illum == 8) &&
         is_bright(m.specular) && m.roughness == 0.0f;
}
/// A mirror that reflects more the flatter it is looked at.
[[nodiscard]] inline bool is_fresnel_mirror(const Material& m) noexcept { return is_mirror(m) && m.illum == 5; }
[[nodiscard]] inline bool is_glossy(const Material& m) noexcept {
  return !is_dielectric(m) && !is_invisible(m) && !is_mirror(m) && is_bright(m.specular) && m.illum >= 2;
}
[[nodiscard]] inline bool is_diffuse(const Material& m) noexcept {
  return !is_dielectric(m) && !is_invisible(m) && (is_bright(m.diffuse) || !m.diffuse_map.empty());
}

}  // namespace arboretum
