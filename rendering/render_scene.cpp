#include "rendering/render_scene.h"

#include <algorithm>

#include "core/error.h"
#include "scenes/appearance.h"
#include "scenes/camera.h"
#include "scenes/layout.h"

namespace arboretum {
namespace {

/// So that no number needs a look before it is used.
void check_materials(const Scene& scene) {
  const std::vector<std::uint16_t>& numbers = scene.mesh.materials;
  if (!numbers.empty() && numbers.size() != scene.mesh.size())
    throw UserError(scene.name + ": " + std::to_string(scene.mesh.size()) + " triangles have " +
                    std::to_string(numbers.size()) + " materials' numbers");
  const std::size_t materials = std::max<std::size_t>(1, scene.materials.size());
  const auto beyond = std::ranges::find_if(numbers, [&](std::uint16_t number) { return number >= materials; });
  if (beyond != numbers.end())
    throw UserError(scene.name + ": triangle " + std::to_string(beyond - numbers.begin()) + " is of material " +
                    std::to_string(*beyond) + ", but there are " + std::to_string(materials));
}

}  // namespace

RenderScene::RenderScene(const Scene& scene, EffectSet effects)
    : effects_(effects), camera_(view_of(scene)), shutter_(scene.shutter), warnings_(unseen_materials(scene)) {
  take_mesh(scene);
  settle_motion(scene);
  if (!effects.has(EffectKind::dof)) camera_.aperture_radius = 0.0f;
  if (effects.has(EffectKind::env_light) && is_bright(scene.environment))
    environment_ = scene.environment_image.empty() ? Environment(max(scene.environment, Vec3f{}))
                                                   : Environment(read_radiance(scene.environment_image));
  const Bounds3f bounds = mesh_.bounds();
  if (!bounds.empty()) radius_ = 0.5 * length(Vec3d(bounds.upper) - Vec3d(bounds.lower));
  for (const Material& m : scene.materials) surfaces_.push_back(make_surface(m, effects));
  if (surfaces_.empty()) surfaces_.push_back(make_surface(Material{}, effects));
  read_maps(scene.materials);
  has_holes_ = std::ranges::any_of(surfaces_, &Surface::has_holes);
  if (effects.has(EffectKind::shadow_hard) || effects.has(EffectKind::shadow_soft))
    lights_ = LightTable(mesh_, surfaces_, scene.lights, effects);
}

/// Without what cannot be seen.
void RenderScene::take_mesh(const Scene& scene) {
  check_materials(scene);
  mesh_ = scene.mesh, texture_coordinates_ = scene.texture_coordinates;
  std::vector<bool> seen(mesh_.size(), true);
  for (std::size_t i = 0; i < mesh_.size(); ++i) {
    const std::size_t material = mesh_.materials.empty() ? 0 : mesh_.materials[i];
    seen[i] = scene.materials.empty() || !is_invisible(scene.materials[material]);
  }
  if (!effects_.has(EffectKind::instancing)) mesh_.instancing.reset();
  if (std::ranges::find(seen, false) == seen.end()) return;
  if (mesh_.instancing) mesh_.instancing = kept_instances(mesh_, seen);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!seen[i]) continue;
    mesh_.triangles[kept] = mesh_.triangles[i];
    if (!mesh_.materials.empty()) mesh_.materials[kept] = mesh_.materials[i];
    if (!texture_coordinates_.empty()) texture_coordinates_[kept] = texture_coordinates_[i];
    ++kept;
  }
  mesh_.triangles.resize(kept);
  if (!mesh_.materials.empty()) mesh_.materials.resize(kept);
  if (!texture_coordinates_.empty()) texture_coordinates_.resize(kept);
}

void RenderScene::settle_motion(const Scene& scene) {
  if (!mesh_.moves()) return;
  const bool stays =
      std::ranges::all_of(mesh_.later_frames, [&](const auto& frame) { return frame == mesh_.vertices; });
  if (stays)
    mesh_.later_frames.clear();
  else if (!effects_.has(EffectKind::motion_blur) || !(scene.shutter.open < scene.shutter.close))
    mesh_ = pose(mesh_, scene.shutter.open);
}

int RenderScene::texture(const std::string& path, const std::string& place) {
  const auto known = std::ranges::find(texture_numbers_, path, &std::pair<std::string, int>::first);
  if (known != texture_numbers_.end()) return known->second;
  int number = -1;
  if (const std::optional<Image> image = read_image(path)) {
    number = int(textures_.size());
    textures_.emplace_back(*image);
  } else {
    warnings_.push_back(unread_image(place, path));
  }
  texture_numbers_.emplace_back(path, number);
  return number;
}

/// A map multiplies. One of a single value, or without coordinates to look it up at, goes into the surface's own
/// colour.
void RenderScene::read_maps(const std::vector<Material>& materials) {
  bool unplaced = false;
  for (std::size_t i = 0; i < materials.size(); ++i) {
    Surface& s = surfaces_[i];
    const auto stands_for_itself = [&](const Texture& map) {
      unplaced = unplaced || (texture_coordinates_.empty() && !map.is_constant());
      return map.is_constant() || texture_coordinates_.empty();
    };
    const Material& m = materials[i];
    if (const int number = m.diffuse_map.empty() ? -1 : texture(m.diffuse_map, m.diffuse_map_place); number >= 0) {
      const Texture& map = textures_[std::size_t(number)];
      // a map without a Kd, which many files leave out
      if (!is_bright(s.diffuse)) s.diffuse = Vec3f{1, 1, 1} - s.specular;
      if (stands_for_itself(map) || !effects_.has(EffectKind::texture))
        s.diffuse = s.diffuse * map.mean_color();
      else
        s.diffuse_map = number;
    }
    if (!effects_.has(EffectKind::alpha_cutout) || is_dielectric(m) || m.opacity_map.empty()) continue;
    if (const int number = texture(m.opacity_map, m.opacity_map_place); number >= 0) {
      const Texture& map = textures_[std::size_t(number)];
      if (stands_for_itself(map))
        s.opacity *= map.mean_opacity();
      else
        s.opacity_map = number;
    }
  }
  if (unplaced) warnings_.emplace_back("the scene has no texture coordinates: images stand as their mean");
}

std::array<float, 2> RenderScene::coordinates(const Hit& hit) const noexcept {
  const TextureTriangle& t = texture_coordinates_[hit.primitive];
  const float a = 1.0f - hit.u - hit.v;
  return {t[0][0] * a + t[1][0] * hit.u + t[2][0] * hit.v, t[0][1] * a + t[1][1] * hit.u + t[2][1] * hit.v};
}

Vec3f RenderScene::diffuse(const Surface& surface, const Hit& hit) const noexcept {
  if (!effects_.has(EffectKind::texture) || surface.diffuse_map < 0) return surface.diffuse;
  return surface.diffuse * textures_[std::size_t(surface.diffuse_map)].color(coordinates(hit));
}

float RenderScene::opacity(const Surface& surface, const Hit& hit) const noexcept {
  if (surface.opacity_map < 0) return surface.opacity;
  return surface.opacity * textures_[std::size_t(surface.opacity_map)].opacity(coordinates(hit));
}

}  // namespace arboretum
