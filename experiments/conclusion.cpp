#include "experiments/conclusion.h"

#include <fmt/format.h>

#include <cstdio>

#include "experiments/append_file.h"
#include "experiments/plotting.h"
#include "experiments/summary.h"

namespace arboretum {

void print_warnings(const std::vector<std::string>& warnings) {
  for (const std::string& warning : warnings) fmt::print(stderr, "warning: {}\n", warning);
}

void draw_figures(const std::filesystem::path& folder) {
  if (const std::string problem = draw_plots(folder, {}, true); !problem.empty())
    fmt::print(stderr, "warning: {}\n", problem);
}

ExitStatus conclude(const std::filesystem::path& folder, const RunOutcome& outcome, const Plan& plan, bool draw) {
  print_warnings(outcome.warnings);
  const auto [status, why] = verdict(outcome);
  fmt::print("{}\n{}", result_tables(outcome), skipped_lines(plan, outcome));
  flush_output();
  if (status == ExitStatus::kNothingMeasured) {
    fmt::print(stderr, "arboretum: {}\n", why);
    return status;
  }
  if (draw) draw_figures(folder);
  std::error_code ignored;
  const bool report = draw && std::filesystem::exists(folder / "report.html", ignored);
  fmt::print("{}: {}\n", report ? "report" : "results", (folder / (report ? "report.html" : "results.json")).string());
  if (outcome.stopped) fmt::print("stopped at the first wrong answer (--fail-fast)\n");
  fmt::print("{}\n", why);
  return status;
}

}  // namespace arboretum
