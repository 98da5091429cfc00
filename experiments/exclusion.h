// Rays that pass through one primitive each, the one that they start on (SelfIntersection::exclusion), for tracers that
// know nothing of it. A ray whose closest hit is its own primitive is traced again from beyond that hit, with the
// others of the batch of which it is so, until it is of none: kernels pay nothing where nothing is excluded. What else
// lies at the very t of the excluded hit is passed through with it.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/ray.h"
#include "oracle/oracle.h"
#include "structures/accel.h"
#include "traversal/kernel_table.h"

namespace arboretum {

[[nodiscard]] inline const Hit& hit_of(const Hit& answer) noexcept { return answer; }
[[nodiscard]] inline const Hit& hit_of(const ExactHit& answer) noexcept { return answer.hit; }

/// Rays of a batch that go on, with the places that their answers belong to.
struct RaysThatGoOn {
  std::vector<Ray> rays;
  std::vector<float> times;
  std::vector<std::size_t> places;

  void add(const Ray& ray, RayBatch of, std::size_t place) {
    rays.push_back(ray), places.push_back(place);
    if (!of.times.empty()) times.push_back(of.times[place]);
  }
  /// To be traced as those of the batch that they are of are.
  [[nodiscard]] RayBatch batch(const RayBatch& of) const {
    RayBatch b(rays, times);
    b.settings = of.settings;
    return b;
  }
};

/// `trace(rays, answers)` finds closest hits; Answer is Hit or ExactHit. One excluded primitive a ray.
template <class Answer, class Trace>
void trace_excluding(RayBatch rays, std::span<const std::uint32_t> excluded, std::span<Answer> answers,
                     const Trace& trace) {
  trace(rays, answers);
  const auto add_own = [&](RaysThatGoOn& next, Ray ray, std::size_t place) {
    const Hit& hit = hit_of(answers[place]);
    if (!hit.is_hit() || hit.primitive != excluded[place]) return;
    // Strictly beyond: tnear grows with every round, so the rounds end.
    ray.tnear = std::nextafter(std::max(ray.tnear, hit.t), std::numeric_limits<float>::infinity());
    next.add(ray, rays, place);
  };
  RaysThatGoOn rest;
  for (std::size_t i = 0; i < rays.size(); ++i) add_own(rest, rays[i], i);
  std::vector<Answer> found;
  while (!rest.rays.empty()) {
    found.resize(rest.rays.size());
    trace(rest.batch(rays), std::span<Answer>(found));
    RaysThatGoOn next;
    for (std::size_t k = 0; k < found.size(); ++k) {
      answers[rest.places[k]] = found[k];
      add_own(next, rest.rays[k], rest.places[k]);
    }
    rest = std::move(next);
  }
}

/// By a kernel. `counters`, where given, count all that is traced.
void closest_hit_excluding(const KernelRow& kernel, const Accel& accel, RayBatch rays,
                           std::span<const std::uint32_t> excluded, std::span<Hit> hits, Counters* counters = nullptr);
/// Any hit. Its kernels do not say what they met, so rays that met something are traced again for their closest hit.
void any_hit_excluding(const KernelRow& kernel, const Accel& accel, RayBatch rays,
                       std::span<const std::uint32_t> excluded, std::span<std::uint8_t> occluded,
                       Counters* counters = nullptr);
/// The exact answers.
[[nodiscard]] std::vector<ExactHit> closest_hit_excluding(const Oracle& oracle, RayBatch rays,
                                                          std::span<const std::uint32_t> excluded);

}  // namespace arboretum
