#include "rendering/surface.h"

#include <algorithm>
#include <cmath>

namespace arboretum {
namespace {

Vec3f within_one(Vec3f c) {
  const auto clamp = [](float x) { return std::clamp(x, 0.0f, 1.0f); };
  return {clamp(c.x), clamp(c.y), clamp(c.z)};
}

SpecularLobe lobe_of(const Material& m, EffectSet effects) {
  if (is_dielectric(m)) return effects.has(EffectKind::dielectric) ? SpecularLobe::dielectric : SpecularLobe::none;
  if (is_mirror(m)) return effects.has(EffectKind::mirror) ? SpecularLobe::mirror : SpecularLobe::none;
  if (is_glossy(m)) return effects.has(EffectKind::glossy) ? SpecularLobe::glossy : SpecularLobe::none;
  return SpecularLobe::none;
}

}  // namespace

Surface make_surface(const Material& m, EffectSet effects) {
  Surface s;
  const Vec3f specular = within_one(m.specular);
  if (is_diffuse(m)) {
    const bool shared = is_mirror(m) || is_glossy(m);
    s.diffuse = shared ? min(within_one(m.diffuse), Vec3f{1, 1, 1} - specular) : within_one(m.diffuse);
  }
  s.lobe = lobe_of(m, effects);
  if (s.lobe != SpecularLobe::none) s.specular = specular;
  s.fresnel = s.lobe == SpecularLobe::mirror && is_fresnel_mirror(m);
  if (s.lobe == SpecularLobe::dielectric) {
    if (!is_bright(s.specular)) s.specular = {1, 1, 1};  // many MTL files leave Ks of glass out
    s.transmission = within_one(m.transmission);
    s.ior = m.ior > 0.0f ? double(m.ior) : 1.0;
  }
  const double rough = double(m.roughness);
  s.alpha = std::clamp(rough > 0.0 ? rough * rough : std::sqrt(2.0 / (std::max(0.0, double(m.shininess)) + 2.0)),
                       kLeastAlpha, 1.0);
  s.emission = max(m.emission, Vec3f{0, 0, 0});
  if (effects.has(EffectKind::alpha_cutout) && !is_dielectric(m)) s.opacity = std::clamp(m.opacity, 0.0f, 1.0f);
  return s;
}

}  // namespace arboretum
