#include <fmt/format.h>

#include <algorithm>
#include <fstream>

#include "core/names.h"
#include "experiments/axis_words.h"
#include "experiments/commands.h"
#include "experiments/config_plots.h"
#include "experiments/plotting.h"
#include "experiments/result.h"

namespace arboretum {
namespace {

/// The figures that the run was asked for, as its results say; empty: all.
std::vector<std::string> figures_of(const std::filesystem::path& results) {
  std::ifstream stream(results / "results.json");
  const Json document = Json::parse(stream, nullptr, false);
  if (!document.is_object()) return {};
  const Json plots = document.value("context", Json::object()).value("plots", Json::array());
  std::vector<std::string> names;
  for (const Json& plot : plots)
    if (plot.is_string()) names.push_back(plot.get<std::string>());
  return names;
}

}  // namespace

ExitStatus command_plot(const std::filesystem::path& results, const std::vector<std::string>& figures) {
  if (!std::filesystem::is_directory(results)) {
    throw UserError(
        fmt::format("{}: no such folder; give the folder that `run` wrote, as in results/quick", results.string()));
  }
  if (!std::filesystem::exists(results / "results.json") && !std::filesystem::exists(results / "cells.jsonl")) {
    throw UserError(fmt::format("{}: no results.json and no cells.jsonl in it; give the folder that `run` wrote",
                                results.string()));
  }
  const std::vector<std::string> known(plot_names().begin(), plot_names().end());
  for (const std::string& figure : figures) {
    if (std::ranges::find(known, figure) == known.end()) throw UserError(unknown_name_message("plot", figure, known));
  }
  refuse_doubled("plot: --only", figures);
  const std::string problem = draw_plots(results, figures.empty() ? figures_of(results) : figures, false);
  if (!problem.empty()) throw UserError(problem);
  return ExitStatus::kDone;
}

}  // namespace arboretum
