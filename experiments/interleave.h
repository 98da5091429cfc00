// Repetitions of many jobs in random order, through Google Benchmark, so that a machine that slows down for a
// while slows all of them alike.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "experiments/result.h"

namespace arboretum {

/// A loop that Google Benchmark counts: `while (loop.next()) work();`
class TimedLoop {
 public:
  virtual ~TimedLoop() = default;
  [[nodiscard]] virtual bool next() = 0;
};

struct InterleavedJob {
  std::string name;
  std::vector<unsigned> indices;                  ///< of the repetitions to run
  std::uint64_t iterations = 1;                   ///< of each repetition
  std::function<Repetition(TimedLoop&)> measure;  ///< one repetition; fills in the times
  std::function<void(const Repetition&)> ended;   ///< called right after each
};

/// Hands Google Benchmark its own `--benchmark_*` flags, random interleaving on unless they say otherwise; its
/// environment variables (BENCHMARK_OUT, …) take no effect. Call once, before run_interleaved. Throws UserError for a
/// flag that it does not know.
void initialize_benchmark(const std::vector<std::string>& flags);

/// Runs every repetition of every job. What a job throws ends the run and comes out here.
void run_interleaved(std::vector<InterleavedJob> jobs);

}  // namespace arboretum
