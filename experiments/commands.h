// The commands of the command line. Each returns the exit status; errors come out as UserError.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"
#include "experiments/benchmark_flags.h"
#include "experiments/config.h"

namespace arboretum {

struct RunCommand {
  std::filesystem::path config;
  Overrides overrides;
  std::filesystem::path out;  ///< empty: results/<experiment>
  std::string filter, skip;
  bool list = false, dry_run = false, resume = false, fail_fast = false, no_plots = false;
  BenchmarkFlags benchmark;
  std::string command_line;  ///< as typed, for the results
};

ExitStatus command_run(RunCommand command);
/// `axis` empty: all of them.
ExitStatus command_list(const std::string& axis, bool json);
ExitStatus command_info(const std::string& scene, bool json);
ExitStatus command_plot(const std::filesystem::path& results, const std::vector<std::string>& figures);
ExitStatus command_fetch(const std::vector<std::string>& scenes);

}  // namespace arboretum
