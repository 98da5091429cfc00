#include "rendering/workload.h"

#include <algorithm>
#include <array>
#include <bit>
#include <stdexcept>

#include "core/error.h"
#include "core/names.h"
#include "core/random.h"
#include "rendering/directions.h"
#include "rendering/pixels.h"
#include "rendering/surface_point.h"
#include "scenes/camera.h"

namespace arboretum {
namespace {

constexpr std::array<std::string_view, 6> kNames{"primary",    "shadow",  "ambient_occlusion",
                                                 "reflection", "diffuse", "random"};

/// Random dimensions: each workload draws its own, so that two of them never share a number.
enum Dimension : std::uint64_t {
  kTimeDimension = 8,
  kOcclusionDimension = 16,
  kDiffuseDimension = 32,
  kRandomDimension = 48
};

void check_known(std::string_view name) { (void)index_of_name("workload", name, kNames); }

Vec3d point_on_sphere(std::uint64_t seed, std::uint64_t index, std::uint64_t dimension) {
  const double z = 2.0 * random_double(seed, index, dimension) - 1.0;
  const double r = std::sqrt(std::max(0.0, 1.0 - z * z));
  const UnitCircle circle(random_double(seed, index, dimension + 1));
  return {r * circle.cosine, r * circle.sine, z};
}

/// The ray as traced, and as it would be if it started at the hit point itself (but for its origin, which is rounded).
struct SecondaryRay {
  Ray ray, reference;
};

SecondaryRay shadow_ray(const SurfacePoint& surface, Vec3d light, SelfIntersection method) {
  const Vec3d to_light = light - surface.point();
  if (!(length(to_light) > 0.0)) {
    const Ray none{
        .origin = surface.origin(surface.normal(), method), .direction = to_float(surface.normal()), .tfar = 0.0f};
    return {none, none};
  }
  // A light behind the surface is seen from behind: the ray starts on the light's side, or it would meet its
  // own triangle.
  const Vec3d side = dot(to_light, surface.normal()) >= 0.0 ? surface.normal() : surface.normal() * -1.0;
  const auto towards_light = [&](Vec3f origin, Vec3d from) {
    const Vec3d rest = light - from;
    return Ray{.origin = origin, .direction = leaving(rest, side), .tfar = float(length(rest))};
  };
  const Vec3f origin = surface.origin(side, method);
  return {towards_light(origin, Vec3d(origin)), towards_light(to_float(surface.point()), surface.point())};
}

/// When the ray is under way: uniform over the time that the shutter is open.
float time_of(const Scene& scene, const View& view, std::uint64_t index) {
  const double open = scene.shutter.open, close = scene.shutter.close;
  return float(open + (close - open) * random_double(view.seed, index, kTimeDimension));
}

std::vector<Ray> random_rays(const Bounds3f& bounds, const View& view) {
  const Vec3d lower(bounds.lower), upper(bounds.upper);
  const Vec3d center = (lower + upper) * 0.5;
  const double radius = 0.5 * length(upper - lower);
  std::vector<Ray> rays(std::size_t(view.width) * view.height);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    Vec3f from, to;
    for (std::uint64_t attempt = 0; from == to && attempt < 64; ++attempt) {
      from = to_float(center + point_on_sphere(view.seed, i, kRandomDimension + 4 * attempt) * radius);
      to = to_float(center + point_on_sphere(view.seed, i, kRandomDimension + 4 * attempt + 2) * radius);
    }
    const Vec3d chord = Vec3d(to) - Vec3d(from);
    const double distance = length(chord);
    rays[i] = Ray{.origin = from,
                  .direction = distance > 0.0 ? to_float(chord * (1.0 / distance)) : Vec3f{0, 0, 1},
                  .tfar = float(distance)};
  }
  return rays;
}

}  // namespace

std::span<const std::string_view> workload_names() { return kNames; }

bool is_secondary(std::string_view workload) {
  check_known(workload);
  return starts_on_surfaces(workload);
}

bool starts_on_surfaces(std::string_view workload) noexcept {
  return workload == "shadow" || workload == "ambient_occlusion" || workload == "reflection" || workload == "diffuse";
}

RayBatch Workload::batch() const noexcept {
  RayBatch b(rays, times);
  b.coherent = name == "primary";
  return b;
}

Query query_of(std::string_view workload) {
  check_known(workload);
  return workload == "shadow" || workload == "ambient_occlusion" ? Query::any_hit : Query::closest_hit;
}

// A measure that suits rooms and landscapes alike.
Vec3d light_position(const Scene& scene, RayBatch primary_rays, std::span<const Hit> primary_hits) {
  for (const Light& light : scene.lights)
    if (light.type == Light::Type::point) return Vec3d(light.position);
  std::vector<double> distances;
  for (std::size_t i = 0; i < primary_hits.size(); ++i)
    if (primary_hits[i].is_hit())
      distances.push_back(double(primary_hits[i].t) * length(Vec3d(primary_rays[i].direction)));
  const Camera camera = view_of(scene);
  if (distances.empty()) return Vec3d(camera.position);
  const auto median = distances.begin() + std::ptrdiff_t(distances.size() / 2);
  std::nth_element(distances.begin(), median, distances.end());
  return Vec3d(camera.position) + normalize(Vec3d(camera.up)) * (0.25 * *median);
}

Workload make_primary(const Scene& scene, const View& view) {
  check_resolution(view.width, view.height);
  Workload workload{.name = "primary", .query = Query::closest_hit, .rays = {}};
  workload.rays.reserve(std::size_t(view.width) * view.height);
  const RayGenerator camera(view_of(scene), view.width, view.height);
  visit_morton(0, 0, std::bit_ceil(std::max(view.width, view.height)), view.width, view.height,
               [&](unsigned x, unsigned y) { workload.rays.push_back(camera.ray(x + 0.5, y + 0.5)); });
  if (scene.mesh.moves()) {
    for (std::size_t i = 0; i < workload.rays.size(); ++i) workload.times.push_back(time_of(scene, view, i));
  }
  return workload;
}

Workload make_workload(std::string_view name, const Scene& scene, const View& view, RayBatch primary_rays,
                       std::span<const Hit> primary_hits) {
  check_known(name);
  check_resolution(view.width, view.height);
  if (name == "primary") return make_primary(scene, view);
  Workload workload{.name = std::string(name), .query = query_of(name), .rays = {}};
  const Bounds3f bounds = scene.mesh.bounds();
  if (name == "random") {
    workload.rays = random_rays(bounds, view);
    for (std::size_t i = 0; scene.mesh.moves() && i < workload.rays.size(); ++i)
      workload.times.push_back(time_of(scene, view, i));
    return workload;
  }
  if (primary_rays.size() != primary_hits.size())
    throw std::invalid_argument("make_workload: one hit for each primary ray");
  const double diagonal = length(Vec3d(bounds.upper) - Vec3d(bounds.lower));
  const Vec3d light = light_position(scene, primary_rays, primary_hits);
  const SelfIntersection method = view.start.method;
  workload.excludes_sources = method == SelfIntersection::exclusion;
  const float tnear = method == SelfIntersection::epsilon ? float(view.start.epsilon * diagonal) : 0.0f;
  const auto add = [&](Ray ray, const Ray& reference) {
    ray.tnear = tnear;
    workload.rays.push_back(ray), workload.references.push_back(reference);
  };
  workload.rays.reserve(primary_rays.size());
  for (std::size_t i = 0; i < primary_rays.size(); ++i) {
    if (!primary_hits[i].is_hit()) continue;
    const float time = primary_rays.time(i);
    if (scene.mesh.moves()) workload.times.push_back(time);
    const SurfacePoint surface(scene.mesh, primary_rays[i], time, primary_hits[i]);
    const Vec3d normal = surface.normal();
    const auto cosine_about = [&](std::uint64_t dimension) {
      const double u = random_double(view.seed, i, dimension), v = random_double(view.seed, i, dimension + 1);
      return Frame(normal).to_world(cosine_direction(u, UnitCircle(v)));
    };
    workload.sources.push_back(primary_hits[i].primitive);
    workload.starts.push_back(surface.exact_point());
    if (name == "shadow") {
      const SecondaryRay made = shadow_ray(surface, light, method);
      add(made.ray, made.reference);
      continue;
    }
    Ray ray{.origin = surface.origin(normal, method), .direction = {}};
    if (name == "reflection") {
      const Vec3d in = normalize(Vec3d(primary_rays[i].direction));
      ray.direction = leaving(in - normal * (2.0 * dot(in, normal)), normal);
    } else if (name == "diffuse") {
      ray.direction = leaving(cosine_about(kDiffuseDimension), normal);
    } else {
      ray.direction = leaving(cosine_about(kOcclusionDimension), normal);
      ray.tfar = float(kOcclusionReach * diagonal);
    }
    Ray reference = ray;
    reference.origin = to_float(surface.point());
    add(ray, reference);
  }
  return workload;
}

}  // namespace arboretum
