// Scene: a mesh with what is needed to look at it: camera, materials, lights, and what the loader found
// wrong.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/mesh.h"

namespace arboretum {

/// Pinhole or thin-lens camera. Angles in degrees; `vertical_fov` spans the picture's height.
struct Camera {
  Vec3f position{0, 0, 1};
  Vec3f look_at{0, 0, 0};
  Vec3f up{0, 1, 0};
  float vertical_fov = 40.0f;
  bool mirror_x = false;           ///< the source used a left-handed camera
  unsigned width = 0, height = 0;  ///< preferred resolution; 0: none given
  float aperture_radius = 0.0f;
  float focus_distance = 0.0f;
};

/// A material of an MTL file: Kd, Ks, Ke, Tf, Ni, illum, d, map_Kd, map_d.
struct Material {
  std::string name{};
  Vec3f diffuse{0.6f, 0.6f, 0.6f};
  Vec3f specular{0, 0, 0};
  Vec3f emission{0, 0, 0};
  Vec3f transmission{1, 1, 1};  ///< Tf
  float shininess = 0.0f;       ///< Ns
  float roughness = 0.0f;       ///< Pr
  float ior = 1.0f;             ///< Ni
  float opacity = 1.0f;         ///< d
  int illum = 2;
  std::string diffuse_map{}, opacity_map{};              ///< paths of the images; empty: none
  std::string diffuse_map_place{}, opacity_map_place{};  ///< "room.mtl:7: map_Kd", for messages; empty: not known
};

struct Light {
  enum class Type { point, directional, spot } type = Type::point;
  Vec3f position{}, direction{};
  Vec3f intensity{1, 1, 1};
  float cone_degrees = 90.0f;
};

/// What was counted while loading. Nothing of it stops a load; every line of it is reported.
struct LoadReport {
  std::size_t triangles_read = 0;
  std::size_t non_finite = 0;      ///< dropped: a vertex is NaN or infinite
  std::size_t out_of_range = 0;    ///< dropped: a coordinate beyond kMaxCoordinate
  std::size_t degenerate = 0;      ///< dropped: exactly zero area
  int scaled_by = 0;               ///< the exponent of the power of two that rescale() multiplied by; 0: it did not
  std::size_t polygons_split = 0;  ///< faces of more than three corners, triangulated
  std::vector<std::string> warnings{};  ///< one line each
};

/// Texture coordinates of a triangle's corners, v upwards; [0, 1] is one image.
using TextureTriangle = std::array<std::array<float, 2>, 3>;

/// When the shutter is open, in the time of the key frames ([0, 1]); equal times: no motion blur.
struct Shutter {
  float open = 0.0f, close = 0.0f;
};

struct Scene {
  std::string name;
  TriangleMesh mesh;
  std::vector<TextureTriangle> texture_coordinates;  ///< one a triangle of `mesh`, or empty: the scene has none
  std::vector<Material> materials;
  std::vector<Light> lights;
  Vec3f environment{0, 0, 0};       ///< mean radiance from afar
  std::string environment_image{};  ///< latitude-longitude, y up; empty: the radiance is the same all around
  std::optional<Camera> camera;
  Shutter shutter;
  unsigned key_frames = 1;    ///< most key frames of one mesh in the scene file
  std::size_t instances = 0;  ///< transforms that the scene file names; laid out in `mesh`, kept in its `instancing`
  LoadReport report;
};

/// How a configuration names a scene: exactly one of four forms (docs/command-line.md).
struct SceneSpec {
  std::string catalogue;        ///< `bunny`
  std::filesystem::path file;   ///< `{file: model.obj}`
  std::filesystem::path scene;  ///< `{scene: scene.yaml}`
  std::string generator;        ///< `{generate: sphere_flake, triangles: 100000, seed: 1}`
  std::size_t triangles = 100000;
  std::uint64_t seed = 1;
  /// What cells are named after: `bunny`, `model`, a scene file's `name:` (else its stem), `sphere_flake-100000`, with
  /// `-seed2` when the seed is not 1. Throws UserError for a scene file that cannot be read as YAML, or whose name is
  /// of no use.
  [[nodiscard]] std::string name() const;
};

/// Loads or generates. Throws UserError with one clear line for a missing, empty or broken file, an unknown
/// name, or a scene with no triangle left.
[[nodiscard]] Scene load_scene(const SceneSpec& spec);
/// Whether the scene moves, without loading models: it has key frames, and its shutter opens. Throws UserError for a
/// scene file that cannot be read as YAML.
[[nodiscard]] bool scene_moves(const SceneSpec& spec);
/// A command-line word: a catalogue name, a path to a model or scene YAML, or `generator:triangles[:seed]`.
[[nodiscard]] SceneSpec parse_scene_word(const std::string& word);

}  // namespace arboretum
