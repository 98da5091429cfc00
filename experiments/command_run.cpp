#include <fmt/format.h>

#include <cstdio>
#include <fstream>
#include <system_error>

#include "experiments/append_file.h"
#include "experiments/commands.h"
#include "experiments/effective.h"
#include "experiments/interleave.h"
#include "experiments/machine_info.h"
#include "experiments/plan.h"
#include "experiments/plotting.h"
#include "experiments/progress.h"
#include "experiments/results_writer.h"
#include "experiments/runner.h"
#include "experiments/summary.h"
#include "scenes/catalogue.h"

namespace arboretum {
namespace {

/// What a scene is likely to hold, without loading it.
std::size_t expected_triangles(const SceneSpec& spec) {
  constexpr std::size_t kUnknown = 200'000;
  if (!spec.generator.empty()) return spec.triangles;
  return spec.catalogue.empty() ? kUnknown : find_catalogue_entry(spec.catalogue).triangles;
}

/// Triangles a second of a builder with one thread, roughly (docs/performance.md); reinsertion after it not counted.
double triangles_per_second(std::string_view builder) {
  struct Rate {
    std::string_view builder;
    double rate;
  };
  static constexpr Rate kRates[] = {{"embree_high", 1.5e5}, {"high", 2e5},  {"embree_", 1e6},  {"sweep_sah", 3.5e5}, {"ploc", 8e5}, {"morton", 4e6},
                                    {"low", 6e6},           {"octants", 4e5}, {"uniform", 2e6}, {"two_level", 1e6}};
  for (const Rate& r : kRates)
    if (builder.starts_with(r.builder)) return r.rate;
  return 1.5e6;
}
constexpr double kReinsertedPerSecond = 7e5;

/// A rough one: repetitions last min_time, making a cell ready takes a few passes at ten million rays a second.
double estimate_seconds(const Experiment& experiment, const Plan& plan) {
  const MeasureSettings& m = experiment.measure;
  const double pass = double(m.width) * double(m.height) / 1e7;
  std::vector<double> triangles;
  for (const SceneChoice& scene : experiment.scenes) triangles.push_back(double(expected_triangles(scene.spec)));
  double seconds = 0.0;
  for (const Cell& cell : plan.cells) {
    if (cell.metric == Cell::Metric::build) {
      const double a_triangle = 1.0 / triangles_per_second(cell.builder) + (cell.builder.ends_with("_reinsertion") ? 1.0 / kReinsertedPerSecond : 0.0);
      seconds += (1.0 + std::max(m.repetitions, kFewestBuilds)) * triangles[cell.scene_index] * a_triangle;
    } else {
      seconds += m.repetitions * std::max(m.min_time, pass) + (3.0 + m.warmup) * pass;
    }
  }
  return seconds;
}

ExitStatus print_list(const Plan& plan) {
  for (const Cell& cell : plan.cells) fmt::print("{}\n", cell.name());
  return ExitStatus::kDone;
}

ExitStatus print_dry_run(const Experiment& experiment, const Plan& plan) {
  for (const Cell& cell : plan.cells) fmt::print("{}\n", cell.name());
  for (const SkippedCell& cell : plan.skipped) fmt::print("{}  skipped: {}\n", cell.name, cell.reason);
  fmt::print("\n{} cells, {} skipped, {} excluded, {} filtered out; about {}\n", plan.cells.size(),
             plan.skipped.size(), plan.excluded, plan.filtered,
             format_duration(estimate_seconds(experiment, plan)));
  fmt::print("{}", skipped_lines(plan, {}));
  return ExitStatus::kDone;
}

/// A catalogue model that is not on this machine stops the run before anything is measured.
void require_scenes(const Experiment& experiment) {
  for (const SceneChoice& scene : experiment.scenes) {
    if (scene.spec.catalogue.empty()) continue;
    const CatalogueEntry entry = find_catalogue_entry(scene.spec.catalogue);
    if (!entry.is_present()) (void)load_catalogue_scene(entry);  // throws, naming the command that brings it
  }
}

void refuse_other_configuration(const std::filesystem::path& folder, const std::string& hash) {
  std::ifstream stream(folder / "effective.yaml");
  std::string line;
  if (!stream || !std::getline(stream, line)) return;
  constexpr std::string_view kHead = "# configuration hash: ";
  if (line.starts_with(kHead) && line.substr(kHead.size()) == hash) return;
  throw UserError(
      fmt::format("{}: holds the results of another configuration; resume with the command that began it, or "
                  "choose another folder with --out",
                  folder.string()));
}

void write_results(const std::filesystem::path& folder, const RunOutcome& outcome, const Plan& plan,
                   const Json& context, const BenchmarkFlags& flags) {
  const std::string json = results_json(outcome, plan, context), csv = results_csv(outcome);
  write_whole(folder / "results.json", json);
  write_whole(folder / "results.csv", csv);
  if (!flags.out.empty()) write_whole(flags.out, flags.out_format == "csv" ? csv : json);
  if (flags.format == "json") fmt::print("{}", json);
  if (flags.format == "csv") fmt::print("{}", csv);
}

ExitStatus measure(const Experiment& experiment, const Plan& plan, const Registry& registry,
                   const RunCommand& command) {
  const std::filesystem::path folder =
      command.out.empty() ? std::filesystem::path("results") / experiment.name : command.out;
  const std::string hash = configuration_hash(experiment);
  initialize_benchmark(command.benchmark.others);
  require_scenes(experiment);
  make_output_folder(folder);
  if (command.resume) refuse_other_configuration(folder, hash);
  if (!command.benchmark.out.empty())
    AppendFile(command.benchmark.out, true);  // cannot be written: say so now
  const bool replaces = !command.resume && std::filesystem::exists(folder / "cells.jsonl");
  Journal journal(folder, hash, plan, command.resume);
  if (replaces) fmt::print(stderr, "{}: the results of an earlier run are replaced\n", folder.string());
  for (const char* stale : {"results.json", "results.csv", "report.html"}) {
    std::error_code ignored;
    std::filesystem::remove(folder / stale, ignored);
  }
  write_whole(folder / "effective.yaml",
              fmt::format("# configuration hash: {}\n{}", hash, effective_yaml(experiment)));
  const Json context = machine_context(experiment, hash, command.command_line);
  fmt::print(stderr, "{}: {} cells ({} done before), {} skipped; about {}\n", experiment.name,
             plan.cells.size(), journal.done().size(), plan.skipped.size(),
             format_duration(estimate_seconds(experiment, plan)));

  RunOutcome outcome = run_plan(experiment, plan, registry, journal, {.fail_fast = command.fail_fast});
  outcome.warnings = machine_warnings(outcome, plan);
  try {
    write_results(folder, outcome, plan, context, command.benchmark);
  } catch (const UserError&) {
    if (outcome.error.empty()) throw;  // else the first error is the one to mend
  }
  if (!outcome.error.empty()) throw UserError(outcome.error);

  for (const std::string& warning : outcome.warnings) fmt::print(stderr, "warning: {}\n", warning);
  const auto [status, why] = verdict(outcome);
  if (command.benchmark.format != "console") return status;
  fmt::print("{}\n{}", result_tables(outcome), skipped_lines(plan, outcome));
  std::fflush(stdout);
  if (status == ExitStatus::kNothingMeasured) {
    fmt::print(stderr, "arboretum: {}\n", why);
    return status;
  }
  bool report = false;
  if (!command.no_plots && !experiment.plots.empty()) {
    const std::string problem = draw_plots(folder, experiment.plots, true);
    if (!problem.empty()) fmt::print(stderr, "warning: {}\n", problem);
    report = problem.empty();
  }
  fmt::print("{}: {}\n", report ? "report" : "results",
             (folder / (report ? "report.html" : "results.json")).string());
  if (outcome.stopped) fmt::print("stopped at the first wrong answer (--fail-fast)\n");
  fmt::print("{}\n", why);
  return status;
}

}  // namespace

ExitStatus command_run(RunCommand command) {
  if (command.benchmark.repetitions && !command.overrides.repetitions)
    command.overrides.repetitions = command.benchmark.repetitions;
  if (command.benchmark.min_time) command.overrides.min_time = command.benchmark.min_time;
  const Registry registry = this_registry();
  const Experiment experiment = read_experiment(command.config, registry, command.overrides);
  Plan plan = make_plan(experiment, registry);
  apply_filter(plan, command.filter, command.skip);
  apply_filter(plan, command.benchmark.filter, "");
  if (command.list || command.benchmark.list) return print_list(plan);
  if (command.dry_run) return print_dry_run(experiment, plan);
  if (plan.cells.empty()) {
    fmt::print("{}", skipped_lines(plan, {}));
    std::fflush(stdout);
    fmt::print(stderr,
               "arboretum: nothing to measure: {} combinations skipped, {} excluded, {} filtered out\n",
               plan.skipped.size(), plan.excluded, plan.filtered);
    return ExitStatus::kNothingMeasured;
  }
  return measure(experiment, plan, registry, command);
}

}  // namespace arboretum
