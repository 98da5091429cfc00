#include "experiments/trace_job.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "core/timer.h"

namespace arboretum {
namespace {

constexpr std::size_t kRaysPerTask = 4096;  // 64 x 64 pixels of the Morton order
constexpr std::uint64_t kMostPasses = 1'000'000;

}  // namespace

TraceJob::TraceJob(const Cell& cell, const Accel& accel, const Workload& workload, AnswerBuffers& buffers)
    : cell_(cell),
      accel_(accel),
      workload_(workload),
      buffers_(buffers),
      arena_(static_cast<int>(cell.threads)) {
  if (workload.query == Query::closest_hit)
    buffers.hits.resize(std::max(buffers.hits.size(), workload.rays.size()));
  else
    buffers.occluded.resize(std::max(buffers.occluded.size(), workload.rays.size()));
}

void TraceJob::trace(std::size_t rays) const {
  const auto range = [&](std::size_t begin, std::size_t end) {
    const RayBatch batch = workload_.batch().part(begin, end - begin);
    if (workload_.query == Query::closest_hit) {
      cell_.kernel->closest_hit(accel_, batch, std::span(buffers_.hits).subspan(begin, end - begin), nullptr);
    } else {
      cell_.kernel->any_hit(accel_, batch, std::span(buffers_.occluded).subspan(begin, end - begin), nullptr);
    }
  };
  if (cell_.threads == 1) return range(0, rays);
  arena_.execute([&] {
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, rays, kRaysPerTask),
                      [&](const tbb::blocked_range<std::size_t>& r) { range(r.begin(), r.end()); });
  });
}

Counters TraceJob::count() const {
  Counters counters;
  const RayBatch rays = workload_.batch();
  if (workload_.query == Query::closest_hit && cell_.kernel->counts()) {
    cell_.kernel->closest_hit(accel_, rays, std::span(buffers_.hits).first(rays.size()), &counters);
    counters.rays = rays.size();
  } else if (workload_.query == Query::any_hit && cell_.kernel->counts()) {
    cell_.kernel->any_hit(accel_, rays, std::span(buffers_.occluded).first(rays.size()), &counters);
    counters.rays = rays.size();
  }
  return counters;
}

void TraceJob::prepare(Json& facts, SceneData* data, const MeasureSettings& measure) {
  const std::size_t rays = workload_.rays.size();
  const bool closest = workload_.query == Query::closest_hit;
  // A kernel that leaves an answer unwritten must not find the last cell's there.
  std::ranges::fill(buffers_.hits, Hit{.t = -1.0f, .u = 0.0f, .v = 0.0f, .primitive = 0});
  std::ranges::fill(buffers_.occluded, std::uint8_t{0xff});
  trace(rays);
  const auto hits = std::span(buffers_.hits).first(closest ? rays : 0);
  const auto occluded = std::span(buffers_.occluded).first(closest ? 0 : rays);
  facts["rays"] = rays;
  facts["hits"] = closest ? std::ranges::count_if(hits, &Hit::is_hit) : std::ranges::count(occluded, 1);
  if (data)
    add_facts(facts, closest ? data->check(workload_, hits) : data->check(workload_, occluded), closest);
  add_facts(facts, count());

  for (unsigned i = 0; i < measure.warmup; ++i) trace(rays);
  const double begin = wall_seconds();
  trace(rays);
  const double pass = std::max(wall_seconds() - begin, 1e-9);
  passes_ =
      static_cast<std::uint64_t>(std::clamp(std::ceil(measure.min_time / pass), 1.0, double(kMostPasses)));
}

Repetition TraceJob::measure(TimedLoop& loop) const {
  // Another cell ran just before: an untimed eighth of the rays brings this structure's upper nodes back into
  // the cache.
  const std::size_t rays = workload_.rays.size();
  trace(std::max<std::size_t>(rays / 8, 1));
  const auto cpu_seconds = cell_.threads == 1 ? thread_cpu_seconds : process_cpu_seconds;
  const double wall = wall_seconds(), cpu = cpu_seconds();
  while (loop.next()) trace(rays);
  Repetition repetition;
  repetition.cpu_seconds = cpu_seconds() - cpu;
  repetition.wall_seconds = wall_seconds() - wall;
  return repetition;
}

}  // namespace arboretum
