// Google Benchmark's flags on our command line: those that mean something of ours are taken, the rest handed
// on.
#pragma once

#include <optional>
#include <string>
#include <vector>

namespace arboretum {

struct BenchmarkFlags {
  std::optional<unsigned> repetitions;  ///< --benchmark_repetitions
  std::optional<double> min_time;       ///< --benchmark_min_time, seconds
  std::string filter;                   ///< --benchmark_filter
  std::string out;                      ///< --benchmark_out: a copy of the results
  std::string out_format = "json";      ///< --benchmark_out_format: json or csv
  std::string format = "console";       ///< --benchmark_format: what stdout gets
  bool list = false;                    ///< --benchmark_list_tests
  std::vector<std::string> others;      ///< for Google Benchmark itself
};

/// Takes the `--benchmark_*` words out of `words`. Throws UserError for a value that makes no sense.
[[nodiscard]] BenchmarkFlags take_benchmark_flags(std::vector<std::string>& words);

}  // namespace arboretum
