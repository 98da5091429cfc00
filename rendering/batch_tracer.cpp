#include "rendering/batch_tracer.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/timer.h"

namespace arboretum {

RayBatch BatchTracer::batch_of(const TracedRays& rays, std::size_t begin, std::size_t count, RayKind kind) const {
  RayBatch all(rays.rays, rays.times);
  all.coherent = kind == RayKind::camera;  // as Workload::batch()
  all.settings = settings_;
  return all.part(begin, count);
}

void BatchTracer::trace(const RayBatch& rays, std::span<Hit> hits, RayKind kind, RenderStatistics& statistics) const {
  const double begin = thread_cpu_seconds();
  kernel_.closest_hit(accel_, rays, hits);
  statistics[kind].seconds += thread_cpu_seconds() - begin;
  statistics[kind].rays += rays.size();
}

void BatchTracer::closest_hit(const TracedRays& rays, std::size_t begin, std::span<Hit> hits, RayKind kind,
                              RenderStatistics& statistics) const {
  if (hits.empty()) return;
  trace(batch_of(rays, begin, hits.size(), kind), hits, kind, statistics);
  if (scene_.effects().has(EffectKind::alpha_cutout)) pass_holes(rays, begin, hits, PassDimension::path, statistics);
}

void BatchTracer::any_hit(const TracedRays& rays, std::size_t begin, std::span<std::uint8_t> occluded, RayKind kind,
                          RenderStatistics& statistics) const {
  if (occluded.empty()) return;
  const RayBatch batch = batch_of(rays, begin, occluded.size(), kind);
  const double start = thread_cpu_seconds();
  kernel_.any_hit(accel_, batch, occluded);
  statistics[kind].seconds += thread_cpu_seconds() - start;
  statistics[kind].rays += batch.size();
  if (!scene_.effects().has(EffectKind::alpha_cutout) || !scene_.has_holes()) return;

  TracedRays stopped;
  std::vector<std::size_t> places;
  for (std::size_t i = 0; i < occluded.size(); ++i) {
    if (occluded[i] == 0) continue;
    stopped.rays.push_back(rays.rays[begin + i]), stopped.owners.push_back(rays.owners[begin + i]);
    if (!rays.times.empty()) stopped.times.push_back(rays.times[begin + i]);
    places.push_back(i);
  }
  std::vector<Hit> hits(places.size());
  if (hits.empty()) return;
  trace(batch_of(stopped, 0, hits.size(), kind), hits, RayKind::alpha_cutout, statistics);
  pass_holes(stopped, 0, hits, kind == RayKind::env_light ? PassDimension::environment : PassDimension::light,
             statistics);
  for (std::size_t k = 0; k < hits.size(); ++k) occluded[places[k]] = hits[k].is_hit();
}

bool BatchTracer::lets_through(const Hit& hit, const RayOwner& owner, PassDimension dimension,
                               std::uint64_t crossing) const {
  if (!hit.is_hit()) return false;
  const Surface& surface = scene_.surface(hit.primitive);
  if (!surface.has_holes()) return false;
  const float opacity = scene_.opacity(surface, hit);
  return opacity < 1.0f && owner.sampler.pass(owner.node, dimension, crossing) >= double(opacity);
}

void BatchTracer::pass_holes(const TracedRays& rays, std::size_t begin, std::span<Hit> hits, PassDimension dimension,
                             RenderStatistics& statistics) const {
  TracedRays going, next;
  std::vector<std::size_t> places, next_places;
  std::vector<Hit> found;
  const auto add_passing = [&](Ray ray, float time, const RayOwner& owner, std::size_t place, std::uint64_t crossing) {
    const Hit& hit = hits[place];
    if (!lets_through(hit, owner, dimension, crossing)) return;
    // Strictly beyond: tnear grows with every crossing, so they end. What else lies at the very t is passed with it.
    ray.tnear = std::nextafter(std::max(ray.tnear, hit.t), std::numeric_limits<float>::infinity());
    next.rays.push_back(ray), next.owners.push_back(owner), next_places.push_back(place);
    if (!rays.times.empty()) next.times.push_back(time);
  };
  for (std::size_t i = 0; i < hits.size(); ++i)
    add_passing(rays.rays[begin + i], rays.time(begin + i), rays.owners[begin + i], i, 0);
  for (std::uint64_t crossing = 1; next.size() > 0; ++crossing) {
    std::swap(going, next), next.clear();
    std::swap(places, next_places), next_places.clear();
    found.resize(going.size());
    trace(batch_of(going, 0, going.size(), RayKind::alpha_cutout), found, RayKind::alpha_cutout, statistics);
    for (std::size_t k = 0; k < found.size(); ++k) {
      hits[places[k]] = found[k];
      add_passing(going.rays[k], going.time(k), going.owners[k], places[k], crossing);
    }
  }
}

}  // namespace arboretum
