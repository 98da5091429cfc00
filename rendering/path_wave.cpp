#include "rendering/path_wave.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "rendering/directions.h"

namespace arboretum {
namespace {

/// The power heuristic's weight of a way that finds a direction by density `own`, where another one finds it by
/// `other`.
float power_weight(double own, double other) {
  const double ratio = other / own;
  return float(1.0 / (1.0 + ratio * ratio));
}

constexpr std::uint32_t kFirstRoulette = 3;  // hits that are never the last one by chance
constexpr double kMostSurvival = 0.95;
constexpr float kLeastBranch = 0x1p-10f;  // branches of whitted with less of the pixel's light than that end
// a shadow ray ends that much before an area light, by its own rounding
constexpr double kShortOfLight = 1.0 - 0x1p-20;

RayKind kind_of(ScatterKind kind) {
  switch (kind) {
    case ScatterKind::diffuse: return RayKind::diffuse_gi;
    case ScatterKind::glossy: return RayKind::glossy;
    case ScatterKind::mirror: return RayKind::mirror;
    case ScatterKind::dielectric: break;
  }
  return RayKind::dielectric;
}

}  // namespace

struct PathWave::Shading {
  const Ray& ray;
  float time;
  const RayOwner& owner;
  const Path& path;
  const Hit& hit;
  const Surface& surface;
  SurfacePoint point;
  Frame frame;
  std::uint64_t node;  ///< of the hit
  Bsdf bsdf;

  Shading(const RenderScene& scene, const Ray& r, float t, const RayOwner& o, const Path& p, const Hit& h)
      : ray(r), time(t), owner(o), path(p), hit(h), surface(scene.surface(h.primitive)), point(scene.mesh(), r, t, h),
        frame(point.normal()), node(o.node == Sampler::kCamera ? 0 : o.node),
        bsdf(surface, scene.diffuse(surface, h), to_local(normalize(Vec3d(r.direction)) * -1.0), point.is_front()) {}
  /// Where rays start that leave on the viewer's side.
  [[nodiscard]] Vec3f origin() const noexcept {
    if (!known_origin_) known_origin_ = point.origin(point.normal(), SelfIntersection::error_bound);
    return *known_origin_;
  }
  [[nodiscard]] Vec3d to_local(Vec3d v) const noexcept {
    return {dot(v, frame.tangent), dot(v, frame.bitangent), dot(v, frame.normal)};
  }
  [[nodiscard]] double random(HitDimension d) const noexcept { return owner.sampler.hit(node, d); }

 private:
  mutable std::optional<Vec3f> known_origin_;
};

PathWave::PathWave(const BatchTracer& tracer, const RenderSettings& settings)
    : tracer_(tracer), scene_(tracer.scene()), branching_(settings.integrator == Integrator::whitted),
      depth_(settings.depth), clamp_(settings.clamp) {
  bounced_ = branching_ ? Lobes{false, false, true} : Lobes{scene_.effects().has(EffectKind::diffuse_gi), true, true};
}

void PathWave::add(std::uint32_t slot, std::uint32_t bounce, Vec3f radiance) {
  const float most = std::max({radiance.x, radiance.y, radiance.z});
  if (bounce > 0 && most > clamp_) radiance = radiance * (clamp_ / most);
  radiance_[slot] = radiance_[slot] + Vec3d(radiance);
}

void PathWave::trace(TracedRays& camera_rays, std::span<Vec3d> radiance, RenderStatistics& statistics) {
  radiance_ = radiance;
  now_[0].rays = std::move(camera_rays);
  now_[0].paths.resize(radiance.size());
  for (std::uint32_t i = 0; i < radiance.size(); ++i) now_[0].paths[i] = Path{.slot = i};
  while (std::ranges::any_of(now_, [](const Queue& q) { return q.rays.size() > 0; })) {
    for (std::size_t k = 0; k < now_.size(); ++k) {
      const Queue& queue = now_[k];
      hits_.resize(queue.rays.size());
      tracer_.closest_hit(queue.rays, 0, hits_, kPathKinds[k], statistics);
      for (std::size_t i = 0; i < hits_.size(); ++i)
        shade(queue.rays.rays[i], queue.rays.time(i), queue.rays.owners[i], queue.paths[i], hits_[i]);
    }
    trace_shadows(statistics);
    for (Queue& queue : now_) queue.rays.clear(), queue.paths.clear();
    std::swap(now_, next_);
  }
}

void PathWave::trace_shadows(RenderStatistics& statistics) {
  for (std::size_t k = 0; k < shadows_.size(); ++k) {
    ShadowQueue& queue = shadows_[k];
    occluded_.resize(queue.rays.size());
    tracer_.any_hit(queue.rays, 0, occluded_, kShadowKinds[k], statistics);
    for (std::size_t i = 0; i < occluded_.size(); ++i)
      if (occluded_[i] == 0) add(queue.slots[i], queue.bounces[i], queue.light[i]);
    queue.rays.clear(), queue.slots.clear(), queue.bounces.clear(), queue.light.clear();
  }
}

void PathWave::shade(const Ray& ray, float time, const RayOwner& owner, const Path& path, const Hit& hit) {
  if (!hit.is_hit()) {
    if (scene_.effects().has(EffectKind::env_light)) add_escaped(path, normalize(Vec3d(ray.direction)));
    return;
  }
  const Shading at(scene_, ray, time, owner, path, hit);
  if (scene_.effects().has(EffectKind::shadow_soft) && is_bright(at.surface.emission)) add_emission(at);
  if (path.bounce >= depth_) return;
  if (!at.bsdf.is_perfect_only()) {
    if (!scene_.lights().empty()) add_direct_light(at);
    if (scene_.effects().has(EffectKind::env_light)) add_environment(at);
  }
  scatter(at);
}

/// In full where only this ray could find the light, else by its share beside the shadow ray of the hit before.
void PathWave::add_emission(const Shading& at) {
  Vec3f emission = scene_.lights().emission(at.hit.primitive);
  if (at.path.pdf > 0.0) {
    const double light_pdf = scene_.lights().pdf(at.hit.primitive, Vec3d(at.ray.origin), at.point.point(), at.time);
    emission = emission * power_weight(at.path.pdf, light_pdf);
  }
  add(at.path.slot, at.path.bounce, at.path.throughput * emission);
}

void PathWave::add_direct_light(const Shading& at) {
  const LightTable& lights = scene_.lights();
  const bool areas = scene_.effects().has(EffectKind::shadow_soft);
  const double choice = scene_.effects().has(EffectKind::multi_light) ? at.random(HitDimension::light) : 0.0;
  const double u = areas ? at.random(HitDimension::light_u) : 0.0, v = areas ? at.random(HitDimension::light_v) : 0.0;
  const Vec3d from = at.point.point();
  if (!branching_) {
    if (const auto light = lights.sample(from, at.time, choice, u, v)) add_light(at, *light);
    return;
  }
  for (std::size_t i = 0; i < lights.delta_lights(); ++i)
    if (const auto light = lights.delta_light(i, from)) add_light(at, *light);
  if (const auto light = lights.sample_area(from, at.time, choice, u, v)) add_light(at, *light);
}

void PathWave::add_light(const Shading& at, const LightSample& light) {
  const Vec3d in = at.to_local(light.direction);
  if (!(in.z > 0.0)) return;
  const Bsdf::Value value = at.bsdf.evaluate(in);
  Vec3f f = value.diffuse + value.glossy;
  if (light.pdf > 0.0) {  // lobes that a path goes on by may find the light themselves
    const float weight = power_weight(light.pdf, at.bsdf.pdf(in, bounced_));
    f = weighed(value, weight);
  }
  const Vec3f arriving = at.path.throughput * f * light.radiance;
  if (!is_bright(arriving)) return;
  const Vec3d normal = at.point.normal();
  const Vec3f origin = at.origin();
  Ray ray{.origin = origin, .direction = {}};
  if (!light.on) {
    const bool far = std::isinf(light.distance);
    const Vec3d rest = far ? light.direction : at.point.point() + light.direction * light.distance - Vec3d(origin);
    ray.direction = leaving(rest, normal);
    if (!far) ray.tfar = float(length(rest));
    push_shadow(RayKind::shadow_hard, at, ray, arriving);
    return;
  }
  const SurfacePoint end(scene_.mesh(), Ray{.origin = {}, .direction = to_float(light.direction)}, at.time, *light.on);
  const Vec3d rest = Vec3d(end.origin(end.normal(), SelfIntersection::error_bound)) - Vec3d(origin);
  if (!(dot(rest, rest) > 0.0)) return;
  ray.direction = leaving(rest, normal);
  ray.tfar = float(length(rest) * kShortOfLight);
  push_shadow(RayKind::shadow_soft, at, ray, arriving);
}

/// What a shadow ray brings that lobes which paths go on by may find too, with that weight, and the others alone.
Vec3f PathWave::weighed(const Bsdf::Value& value, float weight) const noexcept {
  return value.diffuse * (bounced_.diffuse ? weight : 1.0f) + value.glossy * (bounced_.glossy ? weight : 1.0f);
}

/// A path has left the scene.
void PathWave::add_escaped(const Path& path, Vec3d direction) {
  const Environment& environment = scene_.environment();
  Vec3f radiance = environment.radiance(direction);
  if (!environment.is_constant() && path.pdf > 0.0)
    radiance = radiance * power_weight(path.pdf, environment.pdf(direction));
  add(path.slot, path.bounce, path.throughput * radiance);
}

void PathWave::add_environment(const Shading& at) {
  const Environment& environment = scene_.environment();
  if (environment.is_constant()) return add_constant_environment(at);
  const Environment::Sample sample =
      environment.sample(at.random(HitDimension::environment_u), at.random(HitDimension::environment_v));
  const Vec3d in = at.to_local(sample.direction);
  if (!(sample.pdf > 1e-30) || !(in.z > 0.0)) return;
  const Vec3f f = weighed(at.bsdf.evaluate(in), power_weight(sample.pdf, at.bsdf.pdf(in, bounced_)));
  const Vec3f arriving = at.path.throughput * f * sample.radiance * float(1.0 / sample.pdf);
  if (is_bright(arriving))
    push_shadow(RayKind::env_light, at,
                {.origin = at.origin(), .direction = leaving(sample.direction, at.point.normal())}, arriving);
}

/// The environment's light by the lobes that no path goes on by; the others meet it where they leave the scene.
void PathWave::add_constant_environment(const Shading& at) {
  const Lobes lobes{!bounced_.diffuse, !bounced_.glossy, false};
  if (!lobes.diffuse && !lobes.glossy) return;
  const auto scatter = at.bsdf.scatter(lobes, at.random(HitDimension::environment_lobe),
                                       at.random(HitDimension::environment_u), at.random(HitDimension::environment_v));
  if (!scatter) return;
  const Vec3f arriving = at.path.throughput * scatter->weight * scene_.environment().radiance({});
  if (!is_bright(arriving)) return;
  const Vec3d normal = at.point.normal();
  const Ray ray{.origin = at.origin(), .direction = leaving(at.frame.to_world(scatter->direction), normal)};
  push_shadow(RayKind::env_light, at, ray, arriving);
}

void PathWave::push_shadow(RayKind kind, const Shading& at, const Ray& ray, Vec3f light) {
  ShadowQueue& queue = shadows_[index_of(kind)];
  queue.rays.rays.push_back(ray);
  queue.rays.owners.push_back({at.owner.sampler, at.node});
  if (scene_.effects().has(EffectKind::motion_blur)) queue.rays.times.push_back(at.time);
  queue.slots.push_back(at.path.slot), queue.bounces.push_back(at.path.bounce), queue.light.push_back(light);
}

void PathWave::scatter(const Shading& at) {
  if (branching_) {
    const Bsdf::Branches branches = at.bsdf.branches();
    for (unsigned i = 0; i < branches.count; ++i) go_on(at, branches.directions[i], 2 * at.node + 1 + i);
    return;
  }
  const auto scatter = at.bsdf.scatter(bounced_, at.random(HitDimension::lobe), at.random(HitDimension::direction_u),
                                       at.random(HitDimension::direction_v));
  if (scatter) go_on(at, *scatter, at.node + 1);
}

void PathWave::go_on(const Shading& at, const Scatter& scatter, std::uint64_t node) {
  Path path{at.path.throughput * scatter.weight, at.path.slot, at.path.bounce + 1, scatter.pdf};
  const float most = std::max({path.throughput.x, path.throughput.y, path.throughput.z});
  if (!(most > 0.0f) || (branching_ && most < kLeastBranch)) return;
  if (!branching_ && at.path.bounce >= kFirstRoulette) {
    const double survival = std::min(kMostSurvival, double(most));
    if (at.random(HitDimension::roulette) >= survival) return;
    path.throughput = path.throughput * float(1.0 / survival);
  }
  const bool through = scatter.direction.z < 0.0;
  const Vec3d side = through ? at.point.normal() * -1.0 : at.point.normal();
  Queue& queue = next_[index_of(kind_of(scatter.kind))];
  queue.rays.rays.push_back({.origin = through ? at.point.origin(side, SelfIntersection::error_bound) : at.origin(),
                             .direction = leaving(at.frame.to_world(scatter.direction), side)});
  queue.rays.owners.push_back({at.owner.sampler, node});
  if (scene_.effects().has(EffectKind::motion_blur)) queue.rays.times.push_back(at.time);
  queue.paths.push_back(path);
}

}  // namespace arboretum
