#include "experiments/interleave.h"

#include <benchmark/benchmark.h>

#include <algorithm>
#include <exception>

#include "core/error.h"

namespace arboretum {
namespace {

class StateLoop final : public TimedLoop {
 public:
  explicit StateLoop(benchmark::State& state) : state_(state) {}
  bool next() override {
    ended_ = ended_ || !state_.KeepRunning();
    return !ended_;
  }

 private:
  benchmark::State& state_;
  bool ended_ = false;  ///< KeepRunning must not be asked again
};

/// Results are written by the jobs themselves.
class SilentReporter final : public benchmark::BenchmarkReporter {
 public:
  bool ReportContext(const Context&) override { return true; }
  void ReportRuns(const std::vector<Run>&) override {}
};

}  // namespace

void initialize_benchmark(const std::vector<std::string>& flags) {
  // Google Benchmark's own warm-up would call a job like a repetition, with other iterations; cells are warmed up
  // before. The rest goes before the environment's BENCHMARK_OUT, BENCHMARK_LIST_TESTS and the like: files, lists and
  // formats are the command line's, and hardware counters would be read within what is timed. Our jobs have
  // repetitions, iterations and units of their own.
  std::vector<std::string> words{"--benchmark_enable_random_interleaving=true",
                                 "--benchmark_min_warmup_time=0",
                                 "--benchmark_list_tests=false",
                                 "--benchmark_out=",
                                 "--benchmark_out_format=json",
                                 "--benchmark_format=console",
                                 "--benchmark_color=auto",
                                 "--benchmark_time_unit=",
                                 "--benchmark_context=",
                                 "--benchmark_perf_counters=",
                                 "--v=0"};
  words.insert(words.end(), flags.begin(), flags.end());
  static char name[] = "arboretum";  // Google Benchmark keeps the pointer
  std::vector<char*> arguments{name};
  for (std::string& word : words) arguments.push_back(word.data());
  int count = static_cast<int>(arguments.size());
  benchmark::Initialize(&count, arguments.data());
  if (count > 1)
    throw UserError("Google Benchmark does not take '" + std::string(arguments[1]) +
                    "'; see its user guide for the --benchmark_* flags");
}

void run_interleaved(std::vector<InterleavedJob> jobs) {
  std::exception_ptr thrown;
  benchmark::ClearRegisteredBenchmarks();
  for (InterleavedJob& job : jobs) {
    if (job.indices.empty()) continue;
    benchmark::RegisterBenchmark(job.name.c_str(),
                                 [&job, &thrown, done = std::size_t{0}](benchmark::State& state) mutable {
                                   StateLoop loop(state);
                                   // After an error the loops still run, empty: Google Benchmark insists on equal
                                   // iterations of all repetitions.
                                   const auto run_empty = [&loop] {
                                     while (loop.next()) {
                                     }
                                   };
                                   if (thrown) return run_empty();
                                   try {
                                     Repetition repetition = job.measure(loop);
                                     repetition.index = job.indices.at(done++);
                                     repetition.iterations = job.iterations;
                                     job.ended(repetition);
                                   } catch (...) {  // Google Benchmark is no place to throw through; rethrown below
                                     thrown = std::current_exception();
                                     run_empty();
                                   }
                                 })
        ->Iterations(static_cast<benchmark::IterationCount>(job.iterations))
        ->Repetitions(static_cast<int>(job.indices.size()))
        ->Unit(benchmark::kMillisecond);
  }
  // Of no job Google Benchmark would say that its expression matches none, on stderr.
  if (std::ranges::all_of(jobs, [](const InterleavedJob& job) { return job.indices.empty(); })) return;
  SilentReporter reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter, ".");
  benchmark::ClearRegisteredBenchmarks();
  if (thrown) std::rethrow_exception(thrown);
}

}  // namespace arboretum
