#include "experiments/render_job.h"

#include <algorithm>

#include "core/timer.h"
#include "experiments/passes.h"
#include "experiments/warm_up.h"

namespace arboretum {

RenderJob::RenderJob(const Cell& cell, const Accel& accel, const RenderedRays& rays, AnswerBuffers& buffers)
    : cell_(cell), accel_(accel), rays_(rays), buffers_(buffers) {
  buffers.hits.resize(std::max(buffers.hits.size(), rays.closest().rays.size()));
  buffers.occluded.resize(std::max(buffers.occluded.size(), rays.any().rays.size()));
}

void RenderJob::trace_recorded(Counters* counters) const {
  RayBatch closest = rays_.closest().batch(), any = rays_.any().batch();
  closest.settings = any.settings = cell_.settings;
  cell_.kernel->closest_hit(accel_, closest, std::span(buffers_.hits).first(closest.size()), counters);
  cell_.kernel->any_hit(accel_, any, std::span(buffers_.occluded).first(any.size()), counters);
}

RenderStatistics RenderJob::render() const {
  RenderStatistics statistics;
  static_cast<void>(rays_.render(accel_, *cell_.kernel, cell_.settings, cell_.threads, statistics));
  return statistics;
}

void RenderJob::prepare(Json& facts, SceneData& data, const MeasureSettings& measure) {
  // A kernel that leaves an answer unwritten must not find the last cell's there.
  std::ranges::fill(buffers_.hits, Hit{.t = -1.0f, .u = 0.0f, .v = 0.0f, .primitive = 0});
  std::ranges::fill(buffers_.occluded, std::uint8_t{0xff});
  trace_recorded(nullptr);
  const auto hits = std::span(buffers_.hits).first(rays_.closest().rays.size());
  const auto occluded = std::span(buffers_.occluded).first(rays_.any().rays.size());
  facts["hits"] = std::ranges::count_if(hits, &Hit::is_hit) + std::ranges::count(occluded, 1);
  facts["checked_rays"] = hits.size() + occluded.size();
  AnswerCheck check = data.check(rays_, hits);
  const AnswerCheck any = data.check(rays_, occluded);
  check.missed_hits += any.missed_hits, check.false_hits += any.false_hits;
  add_facts(facts, check, true);
  if (cell_.kernel->counts()) {
    Counters counters;
    trace_recorded(&counters);
    add_facts(facts, counters, hits.size() + occluded.size(), cell_.traversal);
  }
  if (cell_.kernel->tests) facts["leaf_tests"] = cell_.kernel->leaves_compiled_in ? "compiled in" : "called";

  warm_up(measure.warmup, measure.min_warmup_time, [&] { static_cast<void>(render()); });
  const auto seconds = cell_.threads == 1 ? thread_cpu_seconds : wall_seconds;
  RenderStatistics statistics;
  passes_ = passes_lasting(measure.min_time, kMostPasses, [&] {
    const double begin = seconds();
    statistics = render();
    return seconds() - begin;
  });
  facts["rays"] = statistics.total().rays;
  facts["shading_share"] = statistics.seconds > 0.0 ? 1.0 - statistics.total().seconds / statistics.seconds : 0.0;
}

Repetition RenderJob::measure(TimedLoop& loop) const {
  // As TraceJob: brings this structure's upper nodes back into the cache.
  const RayBatch some = rays_.closest().batch().part(0, rays_.closest().rays.size() / 8);
  cell_.kernel->closest_hit(accel_, some, std::span(buffers_.hits).first(some.size()));
  const auto cpu_seconds = cell_.threads == 1 ? thread_cpu_seconds : process_cpu_seconds;
  const double wall = wall_seconds(), cpu = cpu_seconds();
  while (loop.next()) static_cast<void>(render());
  Repetition repetition;
  repetition.cpu_seconds = cpu_seconds() - cpu;
  repetition.wall_seconds = wall_seconds() - wall;
  return repetition;
}

}  // namespace arboretum
