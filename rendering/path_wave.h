// PathWave: many light paths traced together, hit by hit: the rays of all paths that are at the same hit go to the
// kernels as batches, one for each kind of ray. `path` and `whitted` are two settings of it.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "rendering/batch_tracer.h"
#include "rendering/bsdf.h"
#include "rendering/render.h"
#include "rendering/surface_point.h"

namespace arboretum {

class PathWave {
 public:
  PathWave(const BatchTracer& tracer, const RenderSettings& settings);

  /// Radiance along each of the camera rays, which are taken.
  void trace(TracedRays& camera_rays, std::span<Vec3d> radiance, RenderStatistics& statistics);

 private:
  struct Path {
    Vec3f throughput{1, 1, 1};
    std::uint32_t slot = 0;  ///< whose radiance
    std::uint32_t bounce = 0;
    double pdf = 0.0;  ///< of the ray's direction; 0: nothing else could have found what it meets
  };
  struct Queue {
    TracedRays rays;
    std::vector<Path> paths;
  };
  struct ShadowQueue {
    TracedRays rays;
    std::vector<std::uint32_t> slots, bounces;
    std::vector<Vec3f> light;  ///< what arrives where nothing is in between
  };
  /// One hit while it is shaded.
  struct Shading;

  void shade(const Ray& ray, float time, const RayOwner& owner, const Path& path, const Hit& hit);
  void add_emission(const Shading& at);
  void add_direct_light(const Shading& at);
  void add_light(const Shading& at, const LightSample& light);
  void add_escaped(const Path& path, Vec3d direction);
  void add_environment(const Shading& at);
  void add_constant_environment(const Shading& at);
  [[nodiscard]] Vec3f weighed(const Bsdf::Value& value, float weight) const noexcept;
  void go_on(const Shading& at, const Scatter& scatter, std::uint64_t node);
  void scatter(const Shading& at);
  void push_shadow(RayKind kind, const Shading& at, const Ray& ray, Vec3f light);
  void trace_shadows(RenderStatistics& statistics);
  void add(std::uint32_t slot, std::uint32_t bounce, Vec3f radiance);

  static constexpr std::array kPathKinds{RayKind::camera, RayKind::mirror, RayKind::glossy, RayKind::dielectric,
                                         RayKind::diffuse_gi};
  static constexpr std::array kShadowKinds{RayKind::shadow_hard, RayKind::shadow_soft, RayKind::env_light};
  static constexpr std::size_t index_of(RayKind kind) noexcept {
    const auto first = kind >= RayKind::shadow_hard ? RayKind::shadow_hard : RayKind::camera;
    return std::size_t(kind) - std::size_t(first);
  }

  const BatchTracer& tracer_;
  const RenderScene& scene_;
  Lobes bounced_;  ///< that paths go on by; light from the others' directions comes by shadow rays alone
  bool branching_;
  std::uint32_t depth_;
  float clamp_;
  std::array<Queue, kPathKinds.size()> now_, next_;
  std::array<ShadowQueue, kShadowKinds.size()> shadows_;
  std::vector<Hit> hits_;
  std::vector<std::uint8_t> occluded_;
  std::span<Vec3d> radiance_;
};

}  // namespace arboretum
