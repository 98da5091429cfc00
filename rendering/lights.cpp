#include "rendering/lights.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace arboretum {
namespace {

struct Placed {
  Vec3d a, ab, ac, normal;  ///< the normal has the length of twice the area
  Placed(const TriangleMesh& mesh, std::uint32_t triangle, float time) {
    const auto corners = mesh.corners(triangle, frame_at(time, mesh.frames()));
    a = Vec3d(corners[0]), ab = Vec3d(corners[1]) - a, ac = Vec3d(corners[2]) - a;
    normal = cross(ab, ac);
  }
  [[nodiscard]] double area() const { return 0.5 * length(normal); }
};

/// Over the key frames and the moments halfway between them: twice the area is the length of a quadratic function of
/// time, which is 0 all along where it is 0 at three moments.
double largest_area(const TriangleMesh& mesh, std::uint32_t triangle) {
  const std::size_t steps = 2 * (mesh.frames() - 1);
  double area = 0.0;
  for (std::size_t i = 0; i <= steps; ++i)
    area = std::max(area, Placed(mesh, triangle, steps == 0 ? 0.0f : float(i) / float(steps)).area());
  return area;
}

double cosine_of_cone(const Light& light) { return UnitCircle(0.5 * double(light.cone_degrees) / 360.0).cosine; }

}  // namespace

LightTable::LightTable(const TriangleMesh& mesh, const std::vector<Surface>& surfaces, const std::vector<Light>& lights,
                       EffectSet effects)
    : mesh_(&mesh) {
  const Bounds3f bounds = mesh.bounds();
  if (effects.has(EffectKind::shadow_hard))
    add_lights(lights, bounds.empty() ? 0.0 : 0.5 * length(Vec3d(bounds.upper) - Vec3d(bounds.lower)));
  if (effects.has(EffectKind::shadow_soft)) add_triangles(surfaces);
  settle(!effects.has(EffectKind::multi_light));
}

void LightTable::add_lights(const std::vector<Light>& lights, double radius) {
  for (const Light& light : lights) {
    const double cone_cosine = light.type == Light::Type::spot ? cosine_of_cone(light) : -1.0;
    double solid_angle = 2.0 * std::numbers::pi * (1.0 - cone_cosine);
    if (light.type == Light::Type::directional) solid_angle = std::numbers::pi * radius * radius;
    const double power = luminance(light.intensity) * solid_angle;
    if (!is_bright(light.intensity)) continue;
    emitters_.push_back({.light = light,
                         .direction = normalize(Vec3d(light.direction)),
                         .cone_cosine = cone_cosine,
                         .power = std::max(power, 1e-300)});
  }
}

void LightTable::add_triangles(const std::vector<Surface>& surfaces) {
  for (std::uint32_t i = 0; i < mesh_->size(); ++i) {
    const Vec3f emission = surfaces[mesh_->materials.empty() ? 0 : mesh_->materials[i]].emission;
    if (!is_bright(emission)) continue;
    const double power = 2.0 * std::numbers::pi * largest_area(*mesh_, i) * luminance(emission);
    if (power > 0.0) emitters_.push_back({.triangle = i, .emission = emission, .power = power});
  }
}

void LightTable::settle(bool strongest_alone) {
  if (emitters_.empty()) return;
  if (strongest_alone) emitters_ = {*std::ranges::max_element(emitters_, {}, &Emitter::power)};
  delta_lights_ = std::size_t(std::ranges::count(emitters_, ~0u, &Emitter::triangle));
  // Apart from each other: where delta lights hold almost all power, what is left for areas is rounding alone.
  double delta_power = 0.0, area_power = 0.0;
  for (std::size_t i = 0; i < emitters_.size(); ++i)
    (i < delta_lights_ ? delta_power : area_power) += emitters_[i].power;
  double up_to = 0.0, up_to_area = 0.0;
  for (std::size_t i = 0; i < emitters_.size(); ++i) {
    Emitter& e = emitters_[i];
    e.probability = e.power / (delta_power + area_power);
    up_to_.push_back(up_to += e.probability);
    if (i >= delta_lights_) areas_up_to_.push_back(up_to_area += e.probability_among_areas = e.power / area_power);
  }
  up_to_.back() = 1.0;
  if (!areas_up_to_.empty()) areas_up_to_.back() = 1.0;
}

std::optional<LightSample> LightTable::sample(Vec3d from, float time, double choice, double u,
                                              double v) const noexcept {
  if (emitters_.empty()) return std::nullopt;
  const auto chosen = std::size_t(std::ranges::upper_bound(up_to_, choice) - up_to_.begin());
  const std::size_t i = std::min(chosen, emitters_.size() - 1);
  if (i >= delta_lights_) return from_triangle(emitters_[i], emitters_[i].probability, from, time, u, v);
  std::optional<LightSample> light = delta_light(i, from);
  if (light) light->radiance = light->radiance * float(1.0 / emitters_[i].probability);
  return light;
}

std::optional<LightSample> LightTable::sample_area(Vec3d from, float time, double choice, double u,
                                                   double v) const noexcept {
  if (areas_up_to_.empty()) return std::nullopt;
  const auto chosen =
      delta_lights_ + std::size_t(std::ranges::upper_bound(areas_up_to_, choice) - areas_up_to_.begin());
  const Emitter& emitter = emitters_[std::min(chosen, emitters_.size() - 1)];
  return from_triangle(emitter, emitter.probability_among_areas, from, time, u, v);
}

std::optional<LightSample> LightTable::delta_light(std::size_t i, Vec3d from) const noexcept {
  const Emitter& emitter = emitters_[i];
  const Light& light = emitter.light;
  if (light.type == Light::Type::directional)
    return LightSample{emitter.direction * -1.0, std::numeric_limits<double>::infinity(), light.intensity, 0.0, {}};
  const Vec3d to_light = Vec3d(light.position) - from;
  const double distance2 = dot(to_light, to_light), distance = std::sqrt(distance2);
  if (!(distance > 0.0)) return std::nullopt;
  const Vec3d direction = to_light * (1.0 / distance);
  if (light.type == Light::Type::spot && -dot(direction, emitter.direction) < emitter.cone_cosine) return std::nullopt;
  return LightSample{direction, distance, light.intensity * float(1.0 / distance2), 0.0, {}};
}

std::optional<LightSample> LightTable::from_triangle(const Emitter& emitter, double probability, Vec3d from, float time,
                                                     double u, double v) const noexcept {
  const Placed triangle(*mesh_, emitter.triangle, time);
  const double root = std::sqrt(u), b = root * (1.0 - v), c = root * v;
  const Vec3d to_light = triangle.a + triangle.ab * b + triangle.ac * c - from;
  const double distance2 = dot(to_light, to_light), distance = std::sqrt(distance2);
  const double facing = std::abs(dot(triangle.normal, to_light));  // twice the area times the cosine times the distance
  if (!(facing > 0.0) || !(distance > 0.0)) return std::nullopt;
  const double pdf = probability * distance2 * distance * 2.0 / facing;
  if (!(pdf > 1e-30) || !std::isfinite(pdf)) return std::nullopt;  // 1 / pdf stays within float32
  return LightSample{to_light * (1.0 / distance), distance, emitter.emission * float(1.0 / pdf), pdf,
                     Hit{.t = 0.0f, .u = float(b), .v = float(c), .primitive = emitter.triangle}};
}

const LightTable::Emitter* LightTable::of(std::uint32_t triangle) const noexcept {
  const auto first = emitters_.begin() + std::ptrdiff_t(delta_lights_);
  const auto found = std::ranges::lower_bound(first, emitters_.end(), triangle, {}, &Emitter::triangle);
  return found != emitters_.end() && found->triangle == triangle ? &*found : nullptr;
}

double LightTable::pdf(std::uint32_t triangle, Vec3d from, Vec3d point, float time) const noexcept {
  const Emitter* emitter = of(triangle);
  if (!emitter) return 0.0;
  const Vec3d to_light = point - from;
  const double distance2 = dot(to_light, to_light);
  const double facing = std::abs(dot(Placed(*mesh_, triangle, time).normal, to_light));
  return facing > 0.0 ? emitter->probability * distance2 * std::sqrt(distance2) * 2.0 / facing
                      : std::numeric_limits<double>::infinity();
}

Vec3f LightTable::emission(std::uint32_t triangle) const noexcept {
  const Emitter* emitter = of(triangle);
  return emitter ? emitter->emission : Vec3f{};
}

}  // namespace arboretum
