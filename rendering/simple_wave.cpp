#include "rendering/simple_wave.h"

#include "rendering/directions.h"
#include "rendering/surface_point.h"
#include "rendering/workload.h"

namespace arboretum {
namespace {

std::vector<Hit> camera_hits(const BatchTracer& tracer, const TracedRays& rays, RenderStatistics& statistics) {
  std::vector<Hit> hits(rays.size());
  tracer.closest_hit(rays, 0, hits, RayKind::camera, statistics);
  return hits;
}

}  // namespace

void trace_normals(const BatchTracer& tracer, const TracedRays& camera_rays, std::span<Vec3d> radiance,
                   RenderStatistics& statistics) {
  const std::vector<Hit> hits = camera_hits(tracer, camera_rays, statistics);
  for (std::size_t i = 0; i < hits.size(); ++i) {
    if (!hits[i].is_hit()) continue;
    const SurfacePoint point(tracer.scene().mesh(), camera_rays.rays[i], camera_rays.time(i), hits[i]);
    radiance[i] = (point.normal() + Vec3d{1, 1, 1}) * 0.5;
  }
}

void trace_ambient_occlusion(const BatchTracer& tracer, const TracedRays& camera_rays, std::span<Vec3d> radiance,
                             RenderStatistics& statistics) {
  const std::vector<Hit> hits = camera_hits(tracer, camera_rays, statistics);
  TracedRays rays;
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < hits.size(); ++i) {
    if (!hits[i].is_hit()) continue;  // black, or what is open would not stand out from it
    const SurfacePoint point(tracer.scene().mesh(), camera_rays.rays[i], camera_rays.time(i), hits[i]);
    const Sampler& sampler = camera_rays.owners[i].sampler;
    const Vec3d in = cosine_direction(sampler.hit(0, HitDimension::environment_u),
                                      UnitCircle(sampler.hit(0, HitDimension::environment_v)));
    rays.rays.push_back({.origin = point.origin(point.normal(), SelfIntersection::error_bound),
                         .direction = leaving(Frame(point.normal()).to_world(in), point.normal()),
                         .tfar = float(kOcclusionReach * 2.0 * tracer.scene().radius())});
    rays.owners.push_back({sampler, 0});
    if (!camera_rays.times.empty()) rays.times.push_back(camera_rays.time(i));
    places.push_back(i);
  }
  std::vector<std::uint8_t> occluded(places.size());
  tracer.any_hit(rays, 0, occluded, RayKind::ambient_occlusion, statistics);
  for (std::size_t k = 0; k < places.size(); ++k)
    if (occluded[k] == 0) radiance[places[k]] = {1, 1, 1};
}

}  // namespace arboretum
