// The command line: reads the words, runs the command, turns errors into one line and an exit status.
#include "experiments/command_line.h"

#include <CLI/CLI.hpp>
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <new>
#include <optional>
#include <span>
#include <system_error>

#include "core/names.h"
#include "core/parse_number.h"
#include "experiments/append_file.h"
#include "experiments/axis_words.h"
#include "experiments/build_info.h"
#include "experiments/commands.h"
#include "experiments/shell_words.h"
#include "oracle/hard_rays.h"

namespace arboretum {
namespace {

struct Arguments {
  RunCommand run;
  MergeCommand merge;
  CompareCommand compare;
  VerifyCommand verify;
  RenderCommand render;
  std::string axis, scene;
  bool json = false;
  std::filesystem::path results;
  std::vector<std::string> figures, fetched;
};

/// A whole number from 0 to 2^64 - 1. By itself the conversion takes -1 for 2^64 - 1.
std::string refuse_no_count(const std::string& word) {
  return parse_number<std::uint64_t>(word)
             ? ""
             : fmt::format("'{}' is no whole number from 0 to {}", word, ~std::uint64_t{0});
}

/// CLI11's own ranges let NaN through, which then compares with nothing.
auto number_from_to(double low, double high) {
  return [low, high](const std::string& word) -> std::string {
    const std::optional<double> number = parse_number<double>(word);
    return number && *number >= low && *number <= high
               ? ""
               : fmt::format("'{}' is no number from {} to {}", word, low, high);
  };
}

std::string refuse_not_positive(const std::string& word) {
  const std::optional<double> number = parse_number<double>(word);
  return number && *number > 0.0 ? "" : fmt::format("'{}' is no number above 0", word);
}

void declare_run(CLI::App& app, RunCommand& run) {
  CLI::App* c = app.add_subcommand("run", "Run the sweep of a configuration; table, results, plots and report");
  c->add_option("CONFIG", run.config, "The configuration, a YAML file")->required();
  c->add_option("AXIS", run.overrides.axes, "axis=value,value in place of the configuration's (isa=avx2,avx512)");
  c->add_option("--out", run.out, "Result folder (default: results/<experiment>)");
  c->add_flag("--list", run.list, "Print the cells' names and measure nothing");
  c->add_flag("--dry-run", run.dry_run, "Print cells, skipped ones with reasons and a time estimate; measure nothing");
  c->add_option("--filter", run.filter, "Only cells whose name this regular expression finds");
  c->add_option("--skip", run.skip, "No cells whose name this regular expression finds");
  c->add_flag("--resume", run.resume, "Go on with a run that was cut off");
  c->add_option("--shard", run.shard, "I/N: the I-th of N parts of the plan; `merge` joins them");
  c->add_option("--repetitions", run.overrides.repetitions, "Timed repetitions of each cell")
      ->check(CLI::Range(1u, kMaxRepetitions));
  c->add_option("--threads", run.overrides.threads, "Threads, in place of the configuration's")
      ->check(CLI::Range(1u, kMaxThreads));
  c->add_option("--seed", run.overrides.seed, "Seed of the workloads' random numbers")->check(refuse_no_count);
  c->add_flag("--fail-fast", run.fail_fast, "Stop at the first wrong answer");
  c->add_flag("--no-plots", run.no_plots, "Draw no plots and write no report");
  c->footer("Google Benchmark's --benchmark_* flags have its meaning; those that would change nothing are refused.");
}

void declare_merge(CLI::App& app, MergeCommand& merge) {
  CLI::App* c = app.add_subcommand("merge", "Join result folders (shards) of one configuration into one");
  c->add_option("OUT", merge.out, "The folder to write; must hold no results yet")->required();
  c->add_option("PART", merge.parts, "Result folders, as `run --shard` wrote them")->required();
  c->add_flag("--allow-different-machines", merge.options.allow_different_machines,
              "Also parts measured on different machines or builds");
  c->add_flag("--allow-different-revisions", merge.options.allow_different_revisions,
              "Also parts of different git revisions");
  c->add_flag("--require-all", merge.require_all, "An error where a cell of the plan is missing; nothing is written");
  c->add_flag("--no-plots", merge.no_plots, "Draw no plots and write no report");
}

void declare_compare(CLI::App& app, CompareCommand& compare) {
  CLI::App* c = app.add_subcommand(
      "compare", "Two result folders, cell by cell: what of B is faster, slower, or indistinguishable from A");
  c->add_option("A", compare.a, "The result folder compared with (before)")->required();
  c->add_option("B", compare.b, "The result folder compared (after)")->required();
  c->add_option("--min-difference", compare.options.min_difference,
                "Smallest difference of speed that counts, in per cent (default 3)")
      ->check(number_from_to(0.0, 1000.0));
  c->add_option("--significance", compare.options.significance,
                "Share of false findings among the findings at most (default 0.05)")
      ->check(number_from_to(1e-6, 0.5));
  c->add_option(
      "--control", compare.options.control,
      "Cells whose code did not change, by a regular expression (/embree/): speeds are taken relative to theirs");
  c->add_flag(
      "--strict", compare.options.strict,
      "Undecided cells whose whole interval is beyond the smallest difference on the slow side count as slower");
  c->add_option("--filter", compare.filter, "Only cells whose name this regular expression finds");
  c->add_option("--skip", compare.skip, "No cells whose name this regular expression finds");
  c->add_flag("--all", compare.all, "Also list indistinguishable cells where there are many");
  c->add_flag("--allow-different-machines", compare.allow_different_machines,
              "Compare although CPU, compiler or flags differ");
  c->add_flag("--allow-different-settings", compare.options.allow_different_settings,
              "Compare cells of other parameters, resolution or self-intersection, too");
  c->add_option("--json", compare.json, "Write the comparison to this file as JSON (-: stdout)");
  c->add_option("--csv", compare.csv, "Write the cells to this file as CSV (-: stdout)");
  c->add_option("--plot", compare.plot, "Draw the ratios with their intervals to this file (.png, .svg, .pdf)");
  c->footer(
      "Exit status: 0 no regression, 2 usage error, 3 a cell is slower or has new wrong answers, 4 no cell is in "
      "both.");
}

void declare_verify(CLI::App& app, VerifyCommand& verify) {
  CLI::App* c = app.add_subcommand("verify", "Combinations against exact arithmetic, ray by ray, on hard rays");
  c->add_option("SUBJECT", verify.subject,
                "A scene as for `info`, a cases file (.json), or `random`: random small meshes")
      ->required();
  c->add_option("AXIS", verify.axes, "axis=value,value: which combinations (isa=avx2,avx512); axis=all");
  c->add_option("--rays", verify.rays,
                fmt::format("Rays in all (default {}; a cases file: each case once, and mutations of them beyond that)",
                            kVerifyRays))
      ->check(refuse_no_count);
  c->add_option("--seed", verify.seed, "Seed of the rays (default 1)")->check(refuse_no_count);
  c->add_option("--offset", verify.offsets, "Moves the scene by these distances along (1, -3/4, 1/2)")
      ->delimiter(',')
      ->allow_extra_args(false);
  c->add_option("--scale", verify.scales, "Scales the moved scene by these powers of two: -60,0,60")
      ->delimiter(',')
      ->allow_extra_args(false);
  c->add_option("--kinds", verify.kinds,
                fmt::format("Kinds of rays: {}", fmt::join(std::span(kHardKindNames).first(kMadeKinds), ", ")))
      ->delimiter(',')
      ->allow_extra_args(false);
  c->add_option("--out", verify.out, "Folder for verify.csv and the cases found");
  c->add_option("--threads", verify.threads, "Threads (default: all)")->check(CLI::Range(1u, kMaxThreads));
  c->add_flag("--spread", verify.spread, "Share the rays among the combinations instead of giving each all of them");
  c->add_option("--filter", verify.filter, "Only combinations whose name this regular expression finds");
  c->add_option("--skip", verify.skip, "No combinations whose name this regular expression finds");
}

void declare_render(CLI::App& app, RenderCommand& render) {
  CLI::App* c = app.add_subcommand("render", "A picture of a scene, with the effects that it calls for");
  c->add_option("SCENE", render.scene, "A catalogue name, a file, or generator:triangles[:seed]")->required();
  c->add_option("--out", render.out, "The picture: .png, or .pfm for radiance in float32 (default image.png)");
  c->add_option("--effects", render.effects, "auto (what the scene calls for), all, or some of `list effects`: a,b,c");
  CLI::Option* heat_map = c->add_option("--heatmap", render.heat_map,
                                        "In place of light: nodes or triangles that the ray through each pixel visits");
  c->add_option(
      "--integrator", render.integrator,
      "path, whitted, ambient_occlusion, normals (default: path; ambient_occlusion where nothing emits light)");
  c->add_option("--spp", render.settings.samples, "Samples a pixel (default 16)")->check(CLI::Range(1, 65536));
  c->add_option("--resolution", render.resolution,
                "WIDTHxHEIGHT (default: the camera's, up to 640 a side; else 512x512)");
  c->add_option("--depth", render.depth,
                "Scatterings of a path at most (default 32, the most of whitted; 1: direct light)")
      ->check(CLI::Range(0, 4096));
  c->add_option("--clamp", render.clamp,
                "Most light that one path brings at once from beyond its first hit: fewer bright specks, some light "
                "lost (default: none)")
      ->check(refuse_not_positive);
  c->add_option("--exposure", render.exposure,
                "auto, or stops: radiance 1 is white at 0 (default auto; of ambient_occlusion and normals 0)");
  c->add_option("--seed", render.settings.seed, "Seed of the random numbers (default 1)")->check(refuse_no_count);
  for (const char* const of_light : {"--integrator", "--spp", "--depth", "--clamp", "--exposure", "--seed"})
    c->get_option(of_light)->excludes(heat_map);
  c->add_option("--threads", render.settings.threads, "Threads (default: all)")->check(CLI::Range(1u, kMaxThreads));
  c->add_option("--structure", render.kernel.structure,
                "Structure to trace with (default bvh8, bvh4_motion for what moves)");
  c->add_option("--builder", render.kernel.builder, "Its builder");
  c->add_option("--leaf", render.kernel.leaf, "Its leaf block");
  c->add_option("--intersector", render.kernel.intersector,
                "Ray/triangle test (default watertight; of embree pluecker)");
  c->add_option("--box", render.kernel.box, "Box test (default: what suits the intersector)");
  c->add_option("--traversal", render.kernel.traversal,
                "Way of traversal (default auto, or single where the structure has none)");
  c->add_option("--isa", render.kernel.isa, "Instruction set (default: the best)");
}

void declare(CLI::App& app, Arguments& a) {
  app.require_subcommand(0, 1);
  app.set_version_flag("--version", std::string(build_info::kVersion));
  declare_run(app, a.run);
  declare_merge(app, a.merge);
  declare_compare(app, a.compare);
  declare_verify(app, a.verify);
  declare_render(app, a.render);
  CLI::App* list = app.add_subcommand("list", "What can be swept");
  list->add_option("AXIS", a.axis,
                   "structures, builders, leaves, intersectors, boxes, traversals, calls, isas, workloads, "
                   "parameters, scenes, effects, promises");
  list->add_flag("--json", a.json, "As JSON");
  CLI::App* info = app.add_subcommand("info", "What a scene holds");
  info->add_option("SCENE", a.scene, "A catalogue name, a file, or generator:triangles[:seed]")->required();
  info->add_flag("--json", a.json, "As JSON");
  CLI::App* plot = app.add_subcommand("plot", "Draw the figures and the report of a result folder again");
  plot->add_option("RESULTS", a.results, "A folder that `run` wrote")->required();
  plot->add_option("--only", a.figures, "These figures alone")->delimiter(',');
  CLI::App* fetch = app.add_subcommand("fetch", "Bring catalogue scenes from their packages");
  fetch->add_option("SCENE", a.fetched, "Names of `list scenes`")->required();
  for (CLI::App* c : app.get_subcommands({})) c->allow_extras();  // unknown options are named by us, with the nearest
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* c : app.get_subcommands({})) names.push_back(c->get_name());
  return names;
}

/// Of a word cut short, what it begins is meant.
std::string unknown_option(const std::string& word, const std::vector<std::string>& options) {
  std::vector<std::string> begun;
  std::ranges::copy_if(options, std::back_inserter(begun), [&](const std::string& o) { return o.starts_with(word); });
  if (begun.empty() || word == "--") return unknown_name_message("option", word, options);
  return fmt::format("unknown option '{}'; did you mean '{}'? (valid: {})", word, fmt::join(begun, "' or '"),
                     fmt::join(options, " "));
}

void refuse_extras(const CLI::App& command) {
  for (const std::string& word : command.remaining()) {
    if (!word.starts_with("-"))
      throw UserError(fmt::format("{}: '{}' is one word too many; see `arboretum {} --help`", command.get_name(), word,
                                  command.get_name()));
    std::vector<std::string> options;
    for (const CLI::Option* option : command.get_options({})) {
      for (const std::string& name : option->get_lnames()) options.push_back("--" + name);
    }
    throw UserError(fmt::format("{}: {}", command.get_name(), unknown_option(word.substr(0, word.find('=')), options)));
  }
}

/// `--out ''` would mean what leaving --out away means.
void refuse_empty_values(const CLI::App& command) {
  for (const CLI::Option* option : command.get_options({}))
    if (option->get_name() != "--shard" && std::ranges::find(option->results(), "") != option->results().end())
      throw UserError(
          fmt::format("{}: {} has an empty value; give one, or leave it out", command.get_name(), option->get_name()));
}

/// Of these CLI11 says no more than numbers.
void refuse_doubled_options(const CLI::App& app) {
  for (const CLI::App* command : app.get_subcommands())
    for (const CLI::Option* option : command->get_options({}))
      if (option->get_items_expected_max() == 1 && option->count() > 1)
        throw UserError(fmt::format("{}: {} is given {} times; keep one", command->get_name(), option->get_name(),
                                    option->count()));
}

/// The command line without --resume, which would repeat nothing of what was measured.
std::string repeatable(std::vector<std::string> words) {
  std::erase_if(words, [](const std::string& word) { return word == "--resume" || word.starts_with("--resume="); });
  return "arboretum " + shell_line(words);
}

ExitStatus dispatch(std::vector<std::string> words) {
  Arguments a;
  a.render.settings.threads = 0;
  a.run.command_line = a.merge.command_line = repeatable(words);
  CLI::App app("Arboretum: a research testbed of ray-tracing acceleration structures", "arboretum");
  declare(app, a);
  const std::vector<std::string> commands = command_names(app);
  if (words.empty())
    throw UserError(fmt::format("no command; one of {} (arboretum --help says more)", fmt::join(commands, ", ")));
  if (!words.front().starts_with("-") && std::ranges::find(commands, words.front()) == commands.end()) {
    throw UserError(unknown_name_message("command", words.front(), commands));
  }
  if (words.front() == "run") a.run.benchmark = take_benchmark_flags(words);
  try {
    app.parse(std::vector<std::string>(words.rbegin(), words.rend()));  // CLI11 takes the words in reverse
  } catch (const CLI::CallForHelp&) {
    fmt::print("{}", app.help());
    return ExitStatus::kDone;
  } catch (const CLI::CallForVersion& version) {
    fmt::print("{}\n", version.what());
    return ExitStatus::kDone;
  } catch (const CLI::ParseError& e) {
    refuse_doubled_options(app);
    std::string line = e.what();
    std::ranges::replace(line, '\n', ' ');
    throw UserError(fmt::format("{}: {}; see `arboretum {} --help`", words.front(), line, words.front()));
  }
  const auto used = app.get_subcommands();
  if (used.empty()) throw UserError(fmt::format("no command; one of {}", fmt::join(commands, ", ")));
  refuse_extras(*used.front());
  refuse_empty_values(*used.front());
  const std::string name = used.front()->get_name();
  if (name == "run") return command_run(std::move(a.run));
  if (name == "merge") return command_merge(a.merge);
  if (name == "compare") return command_compare(a.compare);
  if (name == "verify") return command_verify(a.verify);
  if (name == "render") return command_render(a.render);
  if (name == "list") return command_list(a.axis, a.json);
  if (name == "info") return command_info(a.scene, a.json);
  if (name == "plot") return command_plot(a.results, a.figures);
  return command_fetch(a.fetched);
}

/// What a shell reports of a program that SIGPIPE ends, as in `arboretum run … --list | head`: no error, and nobody to
/// tell of it.
constexpr int kReaderLeft = 128 + SIGPIPE;

/// One line, whatever the message holds.
int fail(std::string message) {
  std::ranges::replace(message, '\n', ' ');
  fmt::print(stderr, "arboretum: {}\n", message);
  return static_cast<int>(ExitStatus::kUsage);
}

std::string why_no_output(const std::error_code& code) {
  if (code == std::errc::bad_file_descriptor) return "stdout is closed; leave it open, or send it to a file";
  const bool full = code == std::errc::no_space_on_device || code == std::errc::file_too_large;
  return fmt::format("{}; {}", code.message(), full ? "free some space or write elsewhere" : "write elsewhere");
}

/// A closed one of the three would be given to the next file that is opened, and what is printed would go there. To
/// what takes its place nothing can be written but to stderr's.
void fill_closed_descriptors() {
  for (int descriptor : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(descriptor, F_GETFD) < 0)
      static_cast<void>(::open("/dev/null", descriptor == STDERR_FILENO ? O_WRONLY : O_RDONLY));
}

}  // namespace

int command_line(int argc, char** argv) {
  fill_closed_descriptors();
  std::signal(SIGXFSZ, SIG_IGN);  // a file-size limit is told by the failing write, not by a signal
  std::signal(SIGPIPE, SIG_IGN);
  try {
    const int status = static_cast<int>(dispatch({argv + 1, argv + argc}));
    flush_output();
    return status;
  } catch (const UserError& e) {
    std::fflush(stdout);
    return fail(e.what());
  } catch (const std::bad_alloc&) {
    return fail("out of memory; lower the number of triangles or the resolution");
  } catch (const std::filesystem::filesystem_error& e) {
    const std::string where = e.path1().empty() ? "" : e.path1().string() + ": ";
    return fail(fmt::format("{}{}; check the path and its permissions", where, e.code().message()));
  } catch (const std::system_error& e) {
    if (e.code() == std::errc::broken_pipe) return kReaderLeft;
    return fail(fmt::format("output cannot be written: {}", why_no_output(e.code())));
  } catch (const std::exception& e) {
    return fail(fmt::format("internal error: {}; please report it with the command line", e.what()));
  }
}

}  // namespace arboretum
