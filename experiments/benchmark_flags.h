// Google Benchmark's flags on our command line: each has the meaning that it has there, or is refused; none is without
// effect.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace arboretum {

struct BenchmarkFlags {
  std::optional<unsigned> repetitions;                       ///< --benchmark_repetitions
  std::optional<double> min_time;                            ///< --benchmark_min_time, seconds
  std::optional<double> min_warmup_time;                     ///< --benchmark_min_warmup_time, seconds
  std::string filter;                                        ///< --benchmark_filter: cells that the expression finds
  std::string skip;                                          ///< --benchmark_filter=-REGEX: cells that it does not find
  std::string out;                                           ///< --benchmark_out: a copy of the results
  std::string out_format = "json";                           ///< --benchmark_out_format: json or csv
  std::string format = "console";                            ///< --benchmark_format: what stdout gets
  std::string time_unit = "ms";                              ///< --benchmark_time_unit: of what `out` and stdout get
  bool report_aggregates_only = false;                       ///< no repetitions in what `out` and stdout get
  bool display_aggregates_only = false;                      ///< no repetitions in what stdout gets
  bool list = false;                                         ///< --benchmark_list_tests
  std::vector<std::pair<std::string, std::string>> context;  ///< --benchmark_context=key=value,…
  std::vector<std::string> others;                           ///< for Google Benchmark itself
};

/// Takes the `--benchmark_*` words out of `words`. Throws UserError for a flag that is unknown, given twice or without
/// effect here, and for a value that makes no sense.
[[nodiscard]] BenchmarkFlags take_benchmark_flags(std::vector<std::string>& words);

}  // namespace arboretum
