#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <memory>
#include <numeric>
#include <set>
#include <system_error>
#include <thread>

#include "experiments/append_file.h"
#include "experiments/commands.h"
#include "experiments/earlier_run.h"
#include "experiments/conclusion.h"
#include "experiments/config_plots.h"
#include "experiments/crash_note.h"
#include "experiments/effective.h"
#include "experiments/estimate.h"
#include "experiments/folder_lock.h"
#include "experiments/interleave.h"
#include "experiments/interrupt.h"
#include "experiments/machine_info.h"
#include "experiments/name_filter.h"
#include "experiments/plan.h"
#include "experiments/plan_record.h"
#include "experiments/plotting.h"
#include "experiments/progress.h"
#include "experiments/result_folder.h"
#include "experiments/results_writer.h"
#include "experiments/runner.h"
#include "experiments/scene_data.h"
#include "experiments/shard.h"
#include "experiments/summary.h"
#include "experiments/table_text.h"

namespace arboretum {
namespace {

/// Of the cells that are not done. `started`: repetitions of the others that are.
double seconds_left(const Experiment& experiment, const Plan& plan,
                    const std::function<bool(const std::string&)>& is_done,
                    const std::function<std::size_t(const Cell&)>& started = {}) {
  std::vector<Cell> left;
  std::ranges::copy_if(plan.cells, std::back_inserter(left), [&](const Cell& c) { return !is_done(c.name()); });
  const std::vector<double> seconds = estimate_seconds(experiment, left, started);
  return std::accumulate(seconds.begin(), seconds.end(), 0.0);
}

ExitStatus print_list(const Experiment& experiment, const Plan& plan) {
  for (const std::string& line : experiment.left_out) fmt::print(stderr, "{}\n", line);
  for (const Cell& cell : plan.cells) fmt::print("{}\n", cell.name());
  return ExitStatus::kDone;
}

/// Says on stderr why the plan has no cell.
ExitStatus nothing_to_measure(const Plan& plan) {
  flush_output();
  fmt::print(stderr, "arboretum: nothing to measure: {} skipped,{} {} excluded, {} filtered out\n",
             counted(plan.skipped.size(), "combination"),
             plan.in_other_shards ? fmt::format(" {} in other shards,", plan.in_other_shards) : "", plan.excluded,
             plan.filtered);
  return ExitStatus::kNothingMeasured;
}

/// `done`: cells that the folder of a run that is to be gone on with holds.
ExitStatus print_dry_run(const Experiment& experiment, const Plan& plan, const std::set<std::string>& done) {
  for (const Cell& cell : plan.cells) fmt::print("{}\n", cell.name());
  for (const SkippedCell& cell : plan.skipped) fmt::print("{}  skipped: {}\n", cell.name, cell.reason);
  for (std::size_t i = 0; i < std::min(plan.excluded_includes.size(), kMostNamed); ++i)
    fmt::print("{}\n", plan.excluded_includes[i]);
  if (plan.excluded_includes.size() > kMostNamed)
    fmt::print("and {} of `include` that `exclude` takes away\n",
               counted(plan.excluded_includes.size() - kMostNamed, "more cell"));
  for (const std::string& line : experiment.left_out) fmt::print("{}\n", line);
  const std::string others = plan.in_other_shards ? fmt::format(" {} in other shards,", plan.in_other_shards) : "";
  fmt::print(
      "\n{}, {} skipped,{} {} excluded, {} filtered out; about {}\n", counted(plan.cells.size(), "cell"),
      plan.skipped.size(), others, plan.excluded, plan.filtered,
      format_duration(seconds_left(experiment, plan, [&](const std::string& name) { return done.contains(name); })));
  if (!done.empty()) fmt::print("{} done before\n", counted(done.size(), "cell"));
  fmt::print("{}", skipped_lines(plan, {}));
  return plan.cells.empty() ? nothing_to_measure(plan) : ExitStatus::kDone;
}

/// A scene that does not load stops the run before anything is measured and before earlier results are touched. Each
/// that is read or placed is loaded for this, one at a time. Where it is the only scene it stays; of several each is
/// loaded again when its turn comes: a long sweep does not hold all of them. `geometry`: as PlanRecord's; `scenes`: as
/// RunOutcome's.
LoadedScene require_scenes(const Experiment& experiment, const Plan& plan, std::map<std::string, std::string>& geometry,
                           Json& scenes) {
  LoadedScene loaded;
  std::size_t wanted = 0;
  for (std::size_t i = 0; i < experiment.scenes.size(); ++i) {
    const SceneChoice& scene = experiment.scenes[i];
    if (std::ranges::none_of(plan.cells, [i](const Cell& cell) { return cell.scene_index == i; })) continue;
    ++wanted, loaded.data.reset();
    // What is generated was checked with the configuration
    if (!scene.spec.generator.empty() && scene.placing.label.empty()) continue;
    try {
      loaded = {i, std::make_unique<SceneData>(scene, experiment.measure)};
      geometry[scene.name] = loaded.data->geometry();
      scenes[scene.name] = loaded.data->load_report();
    } catch (const UserError& e) {
      throw UserError(fmt::format("{}: {}", scene.where, e.what()));
    }
  }
  if (wanted > 1) loaded.data.reset();
  return loaded;
}

/// While measuring, a structure that cannot be kept is only noted.
void require_structure_cache(const Experiment& experiment) {
  if (experiment.measure.structure_cache.empty()) return;
  try {
    make_output_folder(experiment.measure.structure_cache, "the structure cache", "name another folder");
  } catch (const UserError& e) {
    throw UserError(fmt::format("{}: {}", experiment.structure_cache_where, e.what()));
  }
}

/// A folder that was begun and holds no cell yet is told by effective.yaml.
void expect_configuration(const std::filesystem::path& folder, const std::string& hash) {
  if (const std::string there = hash_of_configuration(folder); !there.empty())
    refuse_other_configuration(folder, there, hash);
}

std::filesystem::path default_folder(const Experiment& experiment, const Shard& shard) {
  const std::string part = shard.is_whole() ? "" : fmt::format("-shard-{}-of-{}", shard.index, shard.of);
  return std::filesystem::path("results") / (experiment.name + part);
}

void write_results(const std::filesystem::path& folder, const RunOutcome& outcome, const Plan& plan,
                   const Json& context, const BenchmarkFlags& flags) {
  write_whole(folder / "results.json", results_json(outcome, plan, context), kGoesOn);
  write_whole(folder / "results.csv", results_csv(outcome), kGoesOn);
  const auto text = [&](const std::string& format, bool aggregates_only) {
    const ResultForm form{.aggregates_only = aggregates_only, .time_unit = flags.time_unit};
    return format == "csv" ? results_csv(outcome, form) : results_json(outcome, plan, context, form);
  };
  if (!flags.out.empty()) write_whole(flags.out, text(flags.out_format, flags.report_aggregates_only));
  if (flags.format != "console")
    fmt::print("{}", text(flags.format, flags.report_aggregates_only || flags.display_aggregates_only));
}

/// Whether plots draw a file of that name: `sah_cost.png`, or of a figure in several parts `sah_cost-2.png`.
bool is_figure_file(std::string_view name) {
  if (!name.ends_with(".png") && !name.ends_with(".svg")) return false;
  const std::string_view stem = name.substr(0, name.size() - 4);
  return std::ranges::any_of(plot_names(), [&](std::string_view plot) {
    if (!stem.starts_with(plot)) return false;
    const std::string_view part = stem.substr(plot.size());
    return part.empty() ||
           (part.size() > 1 && part[0] == '-' && part.find_first_not_of("0123456789", 1) == std::string_view::npos);
  });
}

/// What a run concludes with, its figures among it.
std::vector<std::string> concluding_files(const std::filesystem::path& folder) {
  std::vector<std::string> names{"results.json", "results.csv", "report.html"};
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (is_figure_file(name)) names.push_back(name);
  }
  return names;
}

/// Files of `names` that are in the folder. Others there are not ours.
std::vector<std::string> present(const std::filesystem::path& folder, std::vector<std::string> names) {
  std::error_code ignored;
  std::erase_if(names,
                [&](const std::string& name) { return !std::filesystem::is_regular_file(folder / name, ignored); });
  return names;
}

void remove_files(const std::filesystem::path& folder, const std::vector<std::string>& names) {
  std::error_code ignored;
  for (const std::string& name : names) std::filesystem::remove(folder / name, ignored);
}

/// All that a run writes into its folder.
std::vector<std::string> files_of_run(const std::filesystem::path& folder) {
  std::vector<std::string> names = concluding_files(folder);
  names.insert(names.end(), {"cells.jsonl", "repetitions.jsonl", "effective.yaml", kPlanFile, kCrashFile});
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    const std::string name = entry.path().filename().string();
    if (is_seen_points_file(name)) names.push_back(name);
  }
  return present(folder, std::move(names));
}

/// Nothing measured is lost by a run that begins anew: what the last one left goes to a folder beside it, in place of
/// the one before.
void set_aside(const std::filesystem::path& folder) {
  std::error_code error;
  if (const auto bytes = std::filesystem::file_size(folder / "cells.jsonl", error); error || bytes == 0) return;
  const std::filesystem::path aside = folder / "previous";
  make_output_folder(aside);
  remove_files(aside, files_of_run(aside));
  for (const std::string& name : files_of_run(folder)) {
    std::filesystem::rename(folder / name, aside / name, error);
    if (error)
      throw UserError(fmt::format("{} cannot be moved to {}: {}; choose another folder with --out",
                                  (folder / name).string(), aside.string(), error.message()));
  }
  fmt::print(stderr, "{}: the results of the run before are in {}\n", folder.string(), aside.string());
}

/// What --benchmark_context says of the run goes into the context, beside what is there already and will be.
void add_custom_context(Json& context, const BenchmarkFlags& flags) {
  for (const auto& [key, value] : flags.context) {
    const bool later = std::ranges::any_of(kLaterContextKeys, [&key = key](const char* k) { return key == k; });
    if (later || context.contains(key))
      throw UserError(fmt::format("--benchmark_context: the context has a '{}' of its own; choose another key", key));
    context[key] = value;
  }
}

/// Names of the plan's cells that the folder holds; none where there is none. Refuses what the run would.
std::set<std::string> done_before(const Experiment& experiment, const Plan& plan, const Shard& shard,
                                  const RunCommand& command) {
  const std::filesystem::path folder = command.out.empty() ? default_folder(experiment, shard) : command.out;
  std::error_code ignored;
  if (!std::filesystem::exists(folder / "cells.jsonl", ignored)) return {};
  expect_configuration(folder, configuration_hash(experiment));
  EarlierRun(folder).refuse_other_shard(shard);
  std::set<std::string> held, names;
  for (const CellResult& cell : read_result_folder(folder).cells) held.insert(cell.cell.name());
  for (const Cell& cell : plan.cells)
    if (held.contains(cell.name())) names.insert(cell.name());
  return names;
}

/// `whole`: the plan before the filter. What the folder of a run that is gone on with holds of it stays in the results.
ExitStatus measure(const Experiment& experiment, Plan plan, const Plan& whole, PlanRecord record,
                   const Registry& registry, const RunCommand& command) {
  const Shard shard = record.shard;
  const std::filesystem::path folder = command.out.empty() ? default_folder(experiment, shard) : command.out;
  const std::string hash = configuration_hash(experiment);
  initialize_benchmark(command.benchmark.others);
  Json context = machine_context(experiment, hash, command.command_line);
  add_custom_context(context, command.benchmark);
  if (!command.no_plots) require_chosen_python();
  Json scenes = Json::object();
  LoadedScene loaded = require_scenes(experiment, plan, record.geometry, scenes);
  require_structure_cache(experiment);
  make_output_folder(folder);
  const FolderLock lock(folder, "give another --out");
  if (command.resume) expect_configuration(folder, hash);
  const EarlierRun before = command.resume ? EarlierRun(folder) : EarlierRun();
  before.refuse_other_shard(shard);
  before.refuse_other_geometry(experiment, record.geometry);
  before.take_up_scenes(scenes);
  context["scenes"] = scenes;
  if (!command.benchmark.out.empty()) require_writable(command.benchmark.out);
  if (!command.resume) set_aside(folder), remove_files(folder, {kCrashFile});
  Journal journal(folder, hash, whole, command.resume);
  keep_measured(plan, record, whole, journal.done());
  const double seconds = seconds_left(
      experiment, plan, [&](const std::string& name) { return journal.done().contains(name); },
      [&](const Cell& cell) { return journal.started(cell.name()).size(); });
  write_whole(folder / "effective.yaml",
              fmt::format("{}{}\n{}{}", kConfigurationHashHead, hash,
                          shard.is_whole() ? "" : kShardHead + shard.text() + "\n", effective_yaml(experiment)),
              kGoesOn);
  if (!shard.is_whole()) context["shard"] = shard.text();
  if (const Json parts = before.merged_from(); !parts.is_null()) context["merged_from"] = parts;
  record.context = context;
  record.earlier = before.other_contexts(context);
  std::vector<std::string> changed;
  for (const Json& earlier : record.earlier)
    std::ranges::move(differing_conditions(earlier, context), std::back_inserter(changed));
  write_whole(folder / kPlanFile, to_text(record), kGoesOn);
  remove_files(folder, present(folder, concluding_files(folder)));  // not before something could be written
  for (const std::string& line : experiment.left_out) fmt::print(stderr, "{}\n", line);
  fmt::print(stderr, "{}: {} ({} done before), {} skipped{}; about {}\n", experiment.name,
             counted(plan.cells.size(), "cell"), journal.done().size(), plan.skipped.size(),
             shard.is_whole() ? "" : fmt::format(", {} in other shards", plan.in_other_shards),
             format_duration(seconds));

  RunOutcome outcome;
  {
    const InterruptNote note;
    const CrashNote crash("; cells that ended are kept, and the same command with --resume leaves this out and goes on",
                          folder / kCrashFile);
    outcome = run_plan(experiment, plan, registry, journal,
                       {.fail_fast = command.fail_fast,
                        .geometry = record.geometry,
                        .origin = origin_of(context),
                        .crashed = recorded_crashes(folder / kCrashFile)},
                       std::move(loaded));
  }
  name_origins(outcome.results, before.origin());
  outcome.warnings = changed;
  std::ranges::move(run_warnings(outcome, plan, std::max(1u, std::thread::hardware_concurrency())),
                    std::back_inserter(outcome.warnings));
  context["scenes"].update(outcome.scenes);
  std::ranges::move(dropped_warnings(context["scenes"]), std::back_inserter(outcome.warnings));
  try {
    write_results(folder, outcome, plan, context, command.benchmark);
  } catch (const UserError&) {
    if (outcome.error.empty()) throw;  // else the first error is the one to mend
  }
  if (!outcome.error.empty()) throw UserError(outcome.error);

  if (command.benchmark.format != "console") {
    print_warnings(outcome.warnings);
    flush_output();
    const ExitStatus status = verdict(outcome).first;
    if (!command.no_plots && status != ExitStatus::kNothingMeasured) draw_figures(folder);
    return status;
  }
  return conclude(folder, outcome, plan, !command.no_plots);
}

/// --filter, --skip and --benchmark_filter, as one expression of each kind: a plan's record, and the command that
/// `merge` prints, have one.
std::pair<std::string, std::string> filters_of(const RunCommand& command) {
  const BenchmarkFlags& google = command.benchmark;
  static_cast<void>(NameFilter(command.filter, command.skip)),
      static_cast<void>(NameFilter(google.filter, google.skip));
  const auto both = [](const std::string& a, const std::string& b, auto join) {
    return a.empty() ? b : b.empty() ? a : join(a, b);
  };
  return {
      both(command.filter, google.filter,
           [](const auto& a, const auto& b) { return fmt::format("^(?=.*(?:{}))(?=.*(?:{}))", a, b); }),
      both(command.skip, google.skip, [](const auto& a, const auto& b) { return fmt::format("(?:{})|(?:{})", a, b); })};
}

}  // namespace

ExitStatus command_run(RunCommand command) {
  if (command.benchmark.repetitions && command.overrides.repetitions)
    throw UserError("--repetitions and --benchmark_repetitions say the same; keep one");
  if (command.benchmark.repetitions) command.overrides.repetitions = command.benchmark.repetitions;
  if (command.benchmark.min_warmup_time) command.overrides.min_warmup_time = command.benchmark.min_warmup_time;
  if (command.benchmark.min_time) command.overrides.min_time = command.benchmark.min_time;
  const Shard shard = command.shard ? parse_shard(*command.shard) : Shard{};
  const Registry registry = this_registry();
  const Experiment experiment = read_experiment(command.config, registry, command.overrides);
  Plan plan = make_plan(experiment, registry);
  const auto [filter, skip] = filters_of(command);
  const Plan whole = plan;
  apply_filter(plan, filter, skip);
  const std::map<std::string, unsigned> shards = split_plan(experiment, plan, shard.of);
  PlanRecord record = record_of(plan, shards, shard);
  record.filter = filter, record.skip = skip;
  if (!shard.is_whole()) keep_shard(plan, shards, shard.index);
  if (command.list || command.benchmark.list) return print_list(experiment, plan);
  if (command.dry_run)
    return print_dry_run(experiment, plan,
                         command.resume ? done_before(experiment, plan, shard, command) : std::set<std::string>());
  if (plan.cells.empty()) {
    fmt::print("{}", skipped_lines(plan, {}));
    return nothing_to_measure(plan);
  }
  return measure(experiment, std::move(plan), whole, std::move(record), registry, command);
}

}  // namespace arboretum
