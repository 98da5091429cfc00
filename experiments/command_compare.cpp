#include <fmt/format.h>

#include <cstdio>
#include <set>

#include "experiments/append_file.h"
#include "experiments/commands.h"
#include "experiments/comparison_files.h"
#include "experiments/comparison_text.h"
#include "experiments/name_filter.h"
#include "experiments/plotting.h"
#include "experiments/result_folder.h"
#include "experiments/table_text.h"

namespace arboretum {
namespace {

void filter_cells(ResultFolder& folder, const std::string& filter, const std::string& skip) {
  const NameFilter wanted(filter, skip);
  std::erase_if(folder.cells, [&](const CellResult& r) { return !wanted(r.cell.name()); });
}

/// "--filter 'zzz' leaves"
std::string filters_leave(const std::string& filter, const std::string& skip) {
  std::vector<std::string> options;
  if (!filter.empty()) options.push_back(fmt::format("--filter '{}'", filter));
  if (!skip.empty()) options.push_back(fmt::format("--skip '{}'", skip));
  return fmt::format("{} {}", fmt::join(options, " and "), options.size() == 1 ? "leaves" : "leave");
}

void refuse_different_machines(const ResultFolder& a, const ResultFolder& b) {
  const std::vector<std::string> differences = machine_differences(a.context, b.context);
  if (differences.empty()) return;
  throw UserError(
      fmt::format("{} and {} were measured on different machines or builds ({}); measure both on one, or compare all "
                  "the same with --allow-different-machines",
                  a.path.string(), b.path.string(), fmt::join(differences, "; ")));
}

/// A folder that was begun on another machine is of two, and what its medians say is of neither.
void refuse_begun_elsewhere(const ResultFolder& folder) {
  const std::vector<std::string> differences = begun_elsewhere(folder.begun);
  if (differences.empty()) return;
  throw UserError(
      fmt::format("{} was begun on another machine or build than it was gone on with ({}): its times do not compare; "
                  "measure it anew, or compare all the same with --allow-different-machines",
                  folder.path.string(), fmt::join(differences, "; ")));
}

/// Scenes that hold something else in B than in A, by the hashes of both.
std::set<std::string> different_scenes(const ResultFolder& a, const ResultFolder& b) {
  std::set<std::string> different;
  if (!a.plan || !b.plan) return different;
  for (const auto& [scene, hash] : a.plan->geometry)
    if (const auto other = b.plan->geometry.find(scene); other != b.plan->geometry.end() && other->second != hash)
      different.insert(scene);
  return different;
}

void refuse_unknown_format(const std::filesystem::path& plot) {
  const std::string ending = plot.extension().string();
  if (!plot.empty() && ending != ".png" && ending != ".svg" && ending != ".pdf")
    throw UserError(fmt::format("--plot {}: must end in .png, .svg or .pdf", plot.string()));
}

void write(const std::string& path, const std::string& text) {
  if (path == "-")
    fmt::print("{}", text);
  else if (!path.empty())
    write_whole(path, text);
}

}  // namespace

ExitStatus command_compare(const CompareCommand& command) {
  if (command.json == "-" && command.csv == "-")
    throw UserError("compare: --json and --csv cannot both go to stdout; give one of them a file");
  refuse_unknown_format(command.plot);
  if (!command.plot.empty()) require_chosen_python();
  for (const std::filesystem::path& file :
       {std::filesystem::path(command.json), std::filesystem::path(command.csv), command.plot})
    if (!file.empty() && file != "-") require_writable(file);
  ResultFolder a = read_result_folder(command.a), b = read_result_folder(command.b);
  if (!command.allow_different_machines) {
    refuse_begun_elsewhere(a), refuse_begun_elsewhere(b);
    refuse_different_machines(a, b);
  }
  const std::size_t of_a = a.cells.size(), of_b = b.cells.size();
  filter_cells(a, command.filter, command.skip), filter_cells(b, command.filter, command.skip);
  CompareOptions options = command.options;
  options.other_scenes = different_scenes(a, b);
  options.settings = setting_differences(a.path, b.path);
  Comparison comparison = compare_results(a.cells, b.cells, options);
  if (a.cells.empty() && b.cells.empty() && of_a + of_b > 0)
    comparison.left_nothing =
        fmt::format("{} none of A's {} nor of B's {}", filters_leave(command.filter, command.skip),
                    counted(of_a, "cell"), counted(of_b, "cell"));
  const auto [status, why] = verdict(comparison);
  if (command.json != "-" && command.csv != "-") {
    fmt::print("{}{}", origins_text(a, b, options.settings), comparison_text(comparison, command.all));
    if (status != ExitStatus::kNothingMeasured) fmt::print("\n{}\n", why);
  }
  // After the text: what fails here takes nothing from it.
  write(command.json, comparison_json(comparison, a, b));
  write(command.csv, comparison_csv(comparison));
  if (!command.plot.empty() && !comparison.cells.empty()) {
    flush_output();  // the script may print too
    if (const std::string problem = draw_ratios(comparison_json(comparison, a, b), command.plot); !problem.empty())
      fmt::print(stderr, "warning: {}\n", problem);
  }
  flush_output();
  if (status == ExitStatus::kNothingMeasured) fmt::print(stderr, "arboretum: {}\n", why);
  return status;
}

}  // namespace arboretum
