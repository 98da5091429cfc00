#include "experiments/exclusion.h"

namespace arboretum {

void closest_hit_excluding(const KernelRow& kernel, const Accel& accel, RayBatch rays,
                           std::span<const std::uint32_t> excluded, std::span<Hit> hits, Counters* counters) {
  trace_excluding(rays, excluded, hits,
                  [&](RayBatch some, std::span<Hit> answers) { kernel.closest_hit(accel, some, answers, counters); });
}

void any_hit_excluding(const KernelRow& kernel, const Accel& accel, RayBatch rays,
                       std::span<const std::uint32_t> excluded, std::span<std::uint8_t> occluded, Counters* counters) {
  kernel.any_hit(accel, rays, occluded, counters);
  RaysThatGoOn rest;
  std::vector<std::uint32_t> own;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (occluded[i] == 0) continue;
    rest.add(rays[i], rays, i);
    own.push_back(excluded[i]);
  }
  std::vector<Hit> found(rest.rays.size());
  if (!found.empty()) closest_hit_excluding(kernel, accel, rest.batch(rays), own, found, counters);
  for (std::size_t k = 0; k < found.size(); ++k) occluded[rest.places[k]] = found[k].is_hit();
}

std::vector<ExactHit> closest_hit_excluding(const Oracle& oracle, RayBatch rays,
                                            std::span<const std::uint32_t> excluded) {
  std::vector<ExactHit> hits(rays.size());
  trace_excluding(rays, excluded, std::span(hits), [&](RayBatch some, std::span<ExactHit> answers) {
    std::ranges::copy(oracle.closest_hit(some), answers.begin());
  });
  return hits;
}

}  // namespace arboretum
