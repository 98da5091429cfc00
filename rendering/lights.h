// LightTable: the emitters that hit points send shadow rays to, and how one is chosen: by power, from one random
// number.
//
// Point and spot lights: intensity in power per solid angle; a spot's cone opens by cone_degrees in all and has a sharp
// edge. Directional: irradiance on a surface that faces it. Emissive triangles: radiance Ke on both sides, points
// uniform over the area; one that moves has the power of its largest area while it does. The environment is in no
// table: it has a choice of directions of its own (environment.h), and rays that leave the scene meet it.
#pragma once

#include <optional>
#include <vector>

#include "core/mesh.h"
#include "core/ray.h"
#include "rendering/effect_set.h"
#include "rendering/surface.h"
#include "scenes/scene.h"
#include "scenes/vec3d.h"

namespace arboretum {

/// One emitter as seen from a point.
struct LightSample {
  Vec3d direction;        ///< towards it, of unit length
  double distance = 0.0;  ///< infinite for a directional light
  Vec3f radiance;         ///< arriving, over the probability of the choice: per solid angle, or of delta lights in all
  double pdf = 0.0;       ///< of the direction by solid angle, choice included; 0 for delta lights
  std::optional<Hit> on;  ///< the point of an emissive triangle
};

class LightTable {
 public:
  LightTable() = default;
  /// Emitters without power are left out. Without `multi_light` the strongest alone is kept: no other triangle
  /// emits then (emission()), and if it is a light without an extent, none does.
  LightTable(const TriangleMesh& mesh, const std::vector<Surface>& surfaces, const std::vector<Light>& lights,
             EffectSet effects);

  [[nodiscard]] bool empty() const noexcept { return emitters_.empty(); }
  [[nodiscard]] std::size_t size() const noexcept { return emitters_.size(); }
  /// Lights without an extent come first.
  [[nodiscard]] std::size_t delta_lights() const noexcept { return delta_lights_; }
  /// The emitter that `choice` in [0, 1) falls to, seen from `from` at `time`; nothing where no light arrives.
  [[nodiscard]] std::optional<LightSample> sample(Vec3d from, float time, double choice, double u,
                                                  double v) const noexcept;
  /// Emitter i of those without an extent, with probability 1.
  [[nodiscard]] std::optional<LightSample> delta_light(std::size_t i, Vec3d from) const noexcept;
  /// One of the emissive triangles alone.
  [[nodiscard]] std::optional<LightSample> sample_area(Vec3d from, float time, double choice, double u,
                                                       double v) const noexcept;
  /// Density by which sample() chooses the direction from `from` to `point` on an emissive triangle.
  [[nodiscard]] double pdf(std::uint32_t triangle, Vec3d from, Vec3d point, float time) const noexcept;
  /// What the triangle emits: nothing where it is no emitter of the table.
  [[nodiscard]] Vec3f emission(std::uint32_t triangle) const noexcept;

 private:
  struct Emitter {
    Light light{};                 ///< of one without an extent
    std::uint32_t triangle = ~0u;  ///< else of an emissive triangle
    Vec3f emission{};
    Vec3d direction{};          ///< of a light that has one, of unit length
    double cone_cosine = -1.0;  ///< of a spot's cone
    double power = 0.0, probability = 0.0;
    double probability_among_areas = 0.0;
  };
  [[nodiscard]] std::optional<LightSample> from_triangle(const Emitter& emitter, double probability, Vec3d from,
                                                         float time, double u, double v) const noexcept;
  [[nodiscard]] const Emitter* of(std::uint32_t triangle) const noexcept;
  void add_lights(const std::vector<Light>& lights, double radius);
  void add_triangles(const std::vector<Surface>& surfaces);
  void settle(bool strongest_alone);

  const TriangleMesh* mesh_ = nullptr;
  std::vector<Emitter> emitters_;    ///< triangles in ascending order behind the rest
  std::vector<double> up_to_;        ///< probability of all emitters up to and with this one
  std::vector<double> areas_up_to_;  ///< the same among emissive triangles alone
  std::size_t delta_lights_ = 0;
};

}  // namespace arboretum
