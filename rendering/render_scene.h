// RenderScene: a scene made ready for rendering with a set of effects: the mesh that is traced, surfaces, textures,
// lights. Tables of effects that are not in the set are not made.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "rendering/effect_set.h"
#include "rendering/environment.h"
#include "rendering/lights.h"
#include "rendering/surface.h"
#include "rendering/texture.h"
#include "scenes/scene.h"

namespace arboretum {

class RenderScene {
 public:
  /// Surfaces that cannot be seen (is_invisible) are taken out of the mesh. Without `motion_blur`, and where all key
  /// frames are alike, the mesh stands as when the shutter opens; without `instancing` it keeps no instances. Throws
  /// UserError where a triangle's material is none of the scene's.
  RenderScene(const Scene& scene, EffectSet effects);
  RenderScene(const RenderScene&) = delete;  // the light table points at the mesh
  RenderScene& operator=(const RenderScene&) = delete;

  /// What structures are built from.
  [[nodiscard]] const TriangleMesh& mesh() const noexcept { return mesh_; }
  [[nodiscard]] EffectSet effects() const noexcept { return effects_; }
  [[nodiscard]] const Camera& camera() const noexcept { return camera_; }
  [[nodiscard]] Shutter shutter() const noexcept { return shutter_; }
  [[nodiscard]] const LightTable& lights() const noexcept { return lights_; }
  /// Black without `env_light`.
  [[nodiscard]] const Environment& environment() const noexcept { return environment_; }
  /// Half the diagonal of the mesh.
  [[nodiscard]] double radius() const noexcept { return radius_; }

  [[nodiscard]] const Surface& surface(std::uint32_t triangle) const noexcept {
    return surfaces_[mesh_.materials.empty() ? 0 : mesh_.materials[triangle]];
  }
  /// Colour of the diffuse lobe at a hit.
  [[nodiscard]] Vec3f diffuse(const Surface& surface, const Hit& hit) const noexcept;
  /// The share of light that a hit stops.
  [[nodiscard]] float opacity(const Surface& surface, const Hit& hit) const noexcept;
  /// Some surface lets rays through.
  [[nodiscard]] bool has_holes() const noexcept { return has_holes_; }
  /// One line each: maps that cannot be read or placed, materials that cannot be seen.
  [[nodiscard]] const std::vector<std::string>& warnings() const noexcept { return warnings_; }

 private:
  void take_mesh(const Scene& scene);
  void settle_motion(const Scene& scene);
  void read_maps(const std::vector<Material>& materials);
  int texture(const std::string& path, const std::string& place);
  [[nodiscard]] std::array<float, 2> coordinates(const Hit& hit) const noexcept;

  TriangleMesh mesh_;
  EffectSet effects_;
  Camera camera_;
  Shutter shutter_;
  Environment environment_;
  double radius_ = 0.0;
  std::vector<TextureTriangle> texture_coordinates_;
  std::vector<Surface> surfaces_;
  std::vector<Texture> textures_;
  std::vector<std::pair<std::string, int>> texture_numbers_;
  LightTable lights_;
  bool has_holes_ = false;
  std::vector<std::string> warnings_;
};

}  // namespace arboretum
