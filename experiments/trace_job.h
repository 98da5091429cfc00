// TraceJob: one trace cell made ready to be timed: its answers are known and checked, its work is counted,
// and the number of passes that fill a repetition is set.
#pragma once

#include <tbb/task_arena.h>

#include <vector>

#include "experiments/interleave.h"
#include "experiments/result.h"
#include "experiments/scene_data.h"

namespace arboretum {

/// Where answers go; one for all jobs, since repetitions do not overlap.
struct AnswerBuffers {
  std::vector<Hit> hits;
  std::vector<std::uint8_t> occluded;
};

class TraceJob {
 public:
  /// Nothing is traced yet. All arguments must outlive the job.
  TraceJob(const Cell& cell, const Accel& accel, const Workload& workload, AnswerBuffers& buffers);

  /// Traces all rays once and adds `rays`, `hits` and the check against the exact answers to
  /// the facts; counts the work with the counting kernel; then warms up and finds how many passes last
  /// `min_time` seconds, by the clock that rates are of: the thread's CPU time, of several threads wall time.
  void prepare(Json& facts, SceneData& data, const MeasureSettings& measure);
  [[nodiscard]] std::uint64_t passes() const noexcept { return passes_; }
  /// One repetition: wall time, and CPU time of the thread (of the process where the cell has several).
  [[nodiscard]] Repetition measure(TimedLoop& loop) const;

 private:
  [[nodiscard]] RayBatch batch() const;
  void trace(std::size_t rays) const;
  /// Of `rays`, which begin with ray `first` of the workload, into the buffers, by calls as the cell has them.
  void closest(RayBatch rays, std::size_t first, Counters* counters) const;
  void any(RayBatch rays, std::size_t first, Counters* counters) const;
  /// trace(rays of a call, the first one's place) for each call.
  template <class Trace>
  void by_calls(const RayBatch& rays, const Trace& trace) const;
  [[nodiscard]] Counters count() const;

  const Cell& cell_;
  const Accel& accel_;
  const Workload& workload_;
  AnswerBuffers& buffers_;
  mutable tbb::task_arena arena_;
  const std::size_t rays_a_call_;  ///< 0: all
  std::uint64_t passes_ = 1;
};

}  // namespace arboretum
