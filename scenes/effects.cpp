#include "scenes/effects.h"

#include <algorithm>

#include <fmt/format.h>

#include "scenes/images.h"
#include "scenes/material_kind.h"
#include "scenes/readers.h"

namespace arboretum {
namespace {

/// The materials that a triangle uses, and how many triangles each has.
struct Usage {
  std::vector<std::size_t> triangles;
  explicit Usage(const Scene& scene) : triangles(scene.materials.size(), 0) {
    if (scene.mesh.materials.empty()) {
      if (!triangles.empty()) triangles[0] = scene.mesh.size();
      return;
    }
    for (const std::uint16_t id : scene.mesh.materials)
      if (id < triangles.size()) ++triangles[id];
  }
};

class Effects {
 public:
  explicit Effects(const Scene& scene) : scene_(scene), usage_(scene) {}

  std::vector<Effect> all() {
    lights();
    surfaces();
    camera_and_motion();
    maps();
    for (const std::string_view name : kEffectNames) {
      const auto found = std::find_if(found_.begin(), found_.end(), [&](const Effect& e) { return e.name == name; });
      result_.push_back(*found);
    }
    return std::move(result_);
  }

 private:
  void set(std::string_view name, bool called_for, std::string reason) {
    found_.push_back({name, called_for, std::move(reason)});
  }

  /// Calls for the effect where a used material passes the test, and says how many do.
  template <class Test>
  bool by_material(std::string_view name, const Test& test, std::string_view what) {
    std::size_t materials = 0, triangles = 0, first = 0;
    for (std::size_t i = 0; i < scene_.materials.size(); ++i) {
      if (usage_.triangles[i] == 0 || !test(scene_.materials[i])) continue;
      if (materials++ == 0) first = i;
      triangles += usage_.triangles[i];
    }
    const auto found = [&] {
      const std::string& first_name = scene_.materials[first].name;
      return fmt::format(
          "{}: {} triangle{} of {} material{}{}", what, triangles, triangles == 1 ? "" : "s", materials,
          materials == 1 ? "" : "s",
          first_name.empty() ? "" : fmt::format(", {}{}", materials == 1 ? "" : "first ", one_line(first_name)));
    };
    set(name, materials > 0, materials > 0 ? found() : fmt::format("no {}", what));
    return materials > 0;
  }

  void lights() {
    std::size_t bright = 0;
    for (const Light& light : scene_.lights) bright += is_bright(light.intensity);
    set("shadow_hard", bright > 0,
        bright > 0              ? fmt::format("{} point, spot or directional light{}", bright, bright == 1 ? "" : "s")
        : scene_.lights.empty() ? std::string("no point, spot or directional light")
                                : std::string("all of its lights have intensity 0"));
    std::size_t emitters = 0;
    for (std::size_t i = 0; i < scene_.materials.size(); ++i)
      if (is_bright(scene_.materials[i].emission)) emitters += usage_.triangles[i];
    by_material(
        "shadow_soft", [](const Material& m) { return is_bright(m.emission); }, "light from surfaces (Ke > 0)");
    const bool environment = is_bright(scene_.environment);
    set("env_light", environment,
        environment ? fmt::format("the environment's {}radiance is ({:.3g}, {:.3g}, {:.3g})",
                                  scene_.environment_image.empty() ? "" : "mean ", scene_.environment.x,
                                  scene_.environment.y, scene_.environment.z)
                    : std::string("no environment, or a black one"));
    emitters_ = bright + emitters + environment;
    set("multi_light", emitters_ > 1,
        fmt::format("{} emitter{} in all: {} light{}, {} emissive triangle{}, {} environment{}", emitters_,
                    emitters_ == 1 ? "" : "s", bright, bright == 1 ? "" : "s", emitters, emitters == 1 ? "" : "s",
                    int(environment), environment ? "" : "s"));
  }

  void surfaces() {
    by_material("mirror", is_mirror, "perfect reflection (illum 3, 5 or 8, Ks > 0, Pr 0)");
    by_material("glossy", is_glossy, "rough specular lobe (Ks > 0)");
    by_material("dielectric", is_dielectric,
                "glass (illum 4 to 7 or 9, Tf not black; Ni other than 1 or a coloured Tf)");
    if (emitters_ == 0)
      set("diffuse_gi", false, "nothing emits light");
    else
      by_material("diffuse_gi", is_diffuse, "diffuse surface (Kd > 0) in a lit scene");
  }

  void camera_and_motion() {
    const bool lens = scene_.camera && scene_.camera->aperture_radius > 0.0f && scene_.camera->focus_distance > 0.0f;
    set("dof", lens,
        lens ? fmt::format("the camera's aperture has radius {:g}", scene_.camera->aperture_radius)
             : std::string("a pinhole camera"));
    const bool open = scene_.shutter.close > scene_.shutter.open;
    const TriangleMesh& mesh = scene_.mesh;
    const bool stays =
        mesh.moves() && std::ranges::all_of(mesh.later_frames, [&](const auto& f) { return f == mesh.vertices; });
    set("motion_blur", open && scene_.key_frames > 1 && !stays,
        stays                   ? std::string("all key frames are equal: nothing moves")
        : scene_.key_frames < 2 ? std::string("one key frame: nothing moves")
        : !open                 ? fmt::format("{} key frames, but the shutter is never open", scene_.key_frames)
                : fmt::format("{} key frames, shutter open from {:g} to {:g}", scene_.key_frames, scene_.shutter.open,
                              scene_.shutter.close));
    set("instancing", scene_.instances > 1,
        fmt::format("{} instance{} in the scene file", scene_.instances, scene_.instances == 1 ? "" : "s"));
  }

  void maps() {
    const auto cut_out = [](const Material& m) {
      if (is_dielectric(m) || is_invisible(m)) return false;
      if (m.opacity < 1.0f) return true;
      const auto range = m.opacity_map.empty() ? std::nullopt : value_range(m.opacity_map);
      return range && range->least < 1.0f;
    };
    by_material("alpha_cutout", cut_out, "cut-out (d < 1, or a readable map_d with a value below 1)");
    const auto textured = [](const Material& m) {
      const auto range = m.diffuse_map.empty() ? std::nullopt : value_range(m.diffuse_map);
      return range && !range->constant;
    };
    by_material("texture", textured, "texture (a readable map_Kd of more than one colour)");
  }

  const Scene& scene_;
  Usage usage_;
  std::size_t emitters_ = 0;
  std::vector<Effect> found_, result_;
};

}  // namespace

std::vector<Effect> effects_of(const Scene& scene) { return Effects(scene).all(); }

}  // namespace arboretum
