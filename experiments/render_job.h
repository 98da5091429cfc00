// RenderJob: one cell of a renderer's workload made ready to be timed: its answers to the recorded rays are checked and
// its work on them counted, and the number of pictures that fill a repetition is set.
#pragma once

#include "experiments/rendered_rays.h"
#include "experiments/trace_job.h"

namespace arboretum {

class RenderJob {
 public:
  /// All arguments must outlive the job.
  RenderJob(const Cell& cell, const Accel& accel, const RenderedRays& rays, AnswerBuffers& buffers);

  /// As TraceJob::prepare. `rays` are those of one picture by this cell, `hits` the recorded ones' of both queries.
  void prepare(Json& facts, SceneData& data, const MeasureSettings& measure);
  [[nodiscard]] std::uint64_t passes() const noexcept { return passes_; }
  [[nodiscard]] Repetition measure(TimedLoop& loop) const;

 private:
  void trace_recorded(Counters* counters) const;
  [[nodiscard]] RenderStatistics render() const;

  const Cell& cell_;
  const Accel& accel_;
  const RenderedRays& rays_;
  AnswerBuffers& buffers_;
  std::uint64_t passes_ = 1;
};

}  // namespace arboretum
