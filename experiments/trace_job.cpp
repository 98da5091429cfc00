#include "experiments/trace_job.h"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "core/timer.h"
#include "experiments/call_axis.h"
#include "experiments/exclusion.h"
#include "experiments/passes.h"
#include "experiments/warm_up.h"

namespace arboretum {
namespace {

constexpr std::size_t kRaysPerTask = 4096;  // at least: 64 x 64 pixels of the Morton order
constexpr std::size_t kTasksPerThread = 8;  // at least; `auto` finds out anew in each task how its rays go
constexpr std::size_t kMostPoints = 4000;   // of a cell's leaks

}  // namespace

TraceJob::TraceJob(const Cell& cell, const Accel& accel, const Workload& workload, AnswerBuffers& buffers)
    : cell_(cell), accel_(accel), workload_(workload), buffers_(buffers), arena_(static_cast<int>(cell.threads)),
      rays_a_call_(rays_a_call(cell)) {
  if (workload.query == Query::closest_hit)
    buffers.hits.resize(std::max(buffers.hits.size(), workload.rays.size()));
  else
    buffers.occluded.resize(std::max(buffers.occluded.size(), workload.rays.size()));
}

template <class Trace>
void TraceJob::by_calls(const RayBatch& rays, const Trace& trace) const {
  if (rays_a_call_ == 0) return trace(rays, 0);
  for (std::size_t begin = 0; begin < rays.size(); begin += rays_a_call_)
    trace(rays.part(begin, std::min(rays_a_call_, rays.size() - begin)), begin);
}

void TraceJob::closest(RayBatch rays, std::size_t first, Counters* counters) const {
  by_calls(rays, [&](const RayBatch& part, std::size_t begin) {
    const auto hits = std::span(buffers_.hits).subspan(first + begin, part.size());
    if (workload_.excludes_sources)
      closest_hit_excluding(*cell_.kernel, accel_, part,
                            std::span(workload_.sources).subspan(first + begin, part.size()), hits, counters);
    else
      cell_.kernel->closest_hit(accel_, part, hits, counters);
  });
}

void TraceJob::any(RayBatch rays, std::size_t first, Counters* counters) const {
  by_calls(rays, [&](const RayBatch& part, std::size_t begin) {
    const auto occluded = std::span(buffers_.occluded).subspan(first + begin, part.size());
    if (workload_.excludes_sources)
      any_hit_excluding(*cell_.kernel, accel_, part, std::span(workload_.sources).subspan(first + begin, part.size()),
                        occluded, counters);
    else
      cell_.kernel->any_hit(accel_, part, occluded, counters);
  });
}

RayBatch TraceJob::batch() const {
  RayBatch rays = workload_.batch();
  rays.settings = cell_.settings;
  return rays;
}

void TraceJob::trace(std::size_t rays) const {
  const auto range = [&](std::size_t begin, std::size_t end) {
    const RayBatch batch = this->batch().part(begin, end - begin);
    if (workload_.query == Query::closest_hit)
      closest(batch, begin, nullptr);
    else
      any(batch, begin, nullptr);
  };
  if (cell_.threads == 1) return range(0, rays);
  arena_.execute([&] {
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, rays, std::max(kRaysPerTask, rays / (kTasksPerThread * cell_.threads))),
        [&](const tbb::blocked_range<std::size_t>& r) { range(r.begin(), r.end()); });
  });
}

Counters TraceJob::count() const {
  Counters counters;
  const RayBatch rays = batch();
  if (!cell_.kernel->counts()) return counters;
  if (workload_.query == Query::closest_hit)
    closest(rays, 0, &counters);
  else
    any(rays, 0, &counters);
  return counters;
}

void TraceJob::prepare(Json& facts, SceneData& data, const MeasureSettings& measure) {
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
  add_facts(facts, closest ? data.check(workload_, hits) : data.check(workload_, occluded), closest);
  if (closest && !workload_.pixels.empty()) {
    facts[kLeakPoints] = picture_points(data.leak_pixels(workload_, hits), kMostPoints);
  }
  if (!workload_.starts.empty()) {
    facts["self_intersection"] = to_string(cell_.start.method);
    add_facts(facts, closest ? data.check_starts(workload_, hits) : data.check_starts(workload_, occluded), closest);
    facts["start_distance"] = data.start_distance(workload_);
  }
  add_facts(facts, count(), rays, cell_.traversal);
  if (cell_.kernel->tests) facts["leaf_tests"] = cell_.kernel->leaves_compiled_in ? "compiled in" : "called";

  warm_up(measure.warmup, measure.min_warmup_time, [&] { trace(rays); });
  const auto seconds = cell_.threads == 1 ? thread_cpu_seconds : wall_seconds;
  passes_ = passes_lasting(measure.min_time, kMostPasses, [&] {
    const double begin = seconds();
    trace(rays);
    return seconds() - begin;
  });
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
