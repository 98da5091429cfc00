// Samples, journal, results and verdict of a run; Google Benchmark's flags and interleaving.
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <sstream>
#include <tuple>

#include "core/random.h"
#include "experiments/append_file.h"
#include "experiments/benchmark_flags.h"
#include "experiments/config.h"
#include "experiments/interleave.h"
#include "experiments/journal.h"
#include "experiments/result_folder.h"
#include "experiments/results_writer.h"
#include "experiments/shell_words.h"
#include "experiments/runner.h"
#include "experiments/sampling.h"
#include "experiments/summary.h"
#include "experiments/table_text.h"
#include "tests/catch.h"
#include "tests/experiments_on_paper.h"

using namespace arboretum;
using namespace arboretum::test;

TEST_CASE("median and its interval") {
  CHECK(median(std::vector{3.0, 1.0, 2.0}) == 2.0);
  CHECK(median(std::vector{4.0, 1.0, 2.0, 3.0}) == 2.5);
  const Interval one = median_interval(std::vector{2.0}), two = median_interval(std::vector{3.0, 1.0});
  CHECK((one.low == 2.0 && one.median == 2.0 && one.high == 2.0));
  CHECK((two.low == 1.0 && two.median == 2.0 && two.high == 3.0));
  // Below six the range is all there is; tests/plots/test_numbers.py has the same numbers.
  const Interval five = median_interval(std::vector{5.0, 1.0, 4.0, 2.0, 3.0});
  CHECK((five.low == 1.0 && five.high == 5.0));
  const Interval six = median_interval(std::vector{5.0, 1.0, 4.0, 2.0, 3.0, 26.0});
  CHECK(six.low == Approx(1.0 + 5.0 / 14.0));  // by hand: 62/64 and 50/64 cover, a tenth of the way, lambda 0.5 / 1.4
  CHECK(six.high == Approx(26.0 - 21.0 * 5.0 / 14.0));
  const Interval seven = median_interval(std::vector{9.8, 10.1, 10.0, 9.9, 10.2, 10.0, 50.0});
  CHECK(seven.median == 10.0);
  CHECK(seven.low == Approx(9.8733333333333331));
  CHECK(seven.high == Approx(20.813333333333318));
  CHECK(range_coverage(2) == 0.5);
  CHECK(range_coverage(5) == 0.9375);
  CHECK(interval_name(6, 9) == "95 %");
  CHECK(interval_name(2, 5) == "range");
  CHECK(interval_name(5, 6) == "95 % or range");
  CHECK(interval_name(1, 1) == "interval");
}

TEST_CASE("the interval of a median covers it about 95 times in 100, whatever the noise") {
  constexpr std::uint64_t kTrials = 4000;
  const double ln2 = std::log(2.0);
  for (std::size_t n : {6u, 7u, 9u, 15u}) {
    std::size_t uniform = 0, exponential = 0;
    std::vector<double> flat(n), skewed(n);
    for (std::uint64_t trial = 0; trial < kTrials; ++trial) {
      for (std::size_t i = 0; i < n; ++i) {
        flat[i] = random_double(n, i, trial);
        skewed[i] = -std::log(1.0 - random_double(n + 100, i, trial));
      }
      const Interval a = median_interval(flat), b = median_interval(skewed);
      uniform += a.low <= 0.5 && a.high >= 0.5, exponential += b.low <= ln2 && b.high >= ln2;
    }
    for (std::size_t covered : {uniform, exponential}) {
      INFO(n << " values: " << covered << " of " << kTrials);
      CHECK(covered >= 0.93 * kTrials);
      CHECK(covered <= 0.97 * kTrials);
    }
  }
}

namespace {

/// error_of() by a process that is not root, who may write everywhere.
std::string as_nobody(const auto& action) {
  if (::geteuid() != 0) return error_of(action);
  int ends[2];
  REQUIRE(::pipe(ends) == 0);
  const pid_t child = ::fork();
  if (child == 0) {
    const bool nobody = ::setuid(65534) == 0;
    const std::string said = nobody ? error_of(action) : "setuid failed";
    ::_exit(::write(ends[1], said.data(), said.size()) < 0);
  }
  ::close(ends[1]);
  std::string said(4096, ' ');
  said.resize(std::size_t(std::max<ssize_t>(0, ::read(ends[0], said.data(), said.size()))));
  ::close(ends[0]);
  ::waitpid(child, nullptr, 0);
  return said;
}

}  // namespace

TEST_CASE("files of lines: a torn last line is dropped, an impossible write is one clear line") {
  const Folder folder;
  const fs::path file = folder.write("lines", "{\"a\":1}\n{\"b\":");
  CHECK(read_lines(file).size() == 1);
  AppendFile(file, true).append("{\"c\":3}");
  CHECK(read_lines(file) == std::vector<std::string>{"{\"a\":1}", "{\"c\":3}"});
  if (fs::exists("/dev/full")) {
    const std::string message = error_of([] { AppendFile("/dev/full", true).append("x"); });
    CHECK(message.find("No space left") != std::string::npos);
    CHECK(message.find("--resume") != std::string::npos);
    CHECK(error_of([] { write_whole("/dev/full", "x", kGoesOn); }).find("--resume") != std::string::npos);
    CHECK(error_of([] { write_whole("/dev/full", "x"); }).find("--resume") == std::string::npos);
  }
  CHECK(error_of([&] { write_whole(folder.path() / "none" / "file", "x"); }).find("cannot be written") !=
        std::string::npos);
  fs::permissions(file, fs::perms::all), fs::permissions(folder.path(), fs::perms::all);
  CHECK(as_nobody([&] { require_writable(file); }) == "");
  fs::permissions(folder.path(), fs::perms(0555));
  CHECK_THAT(as_nobody([&] { require_writable(file); }), Catch::Contains("the file may be, but its folder may not"));
  CHECK_THAT(as_nobody([&] { require_writable(folder / "new"); }), Catch::Contains("Permission denied"));
  fs::permissions(folder.path(), fs::perms::owner_all);
  CHECK(error_of([&] { make_output_folder(file / "below"); }).find("output folder") != std::string::npos);
  write_whole(file, "whole");
  CHECK(read_lines(file).empty());
}

namespace {

Repetition repetition(unsigned index, double seconds) {
  return {.index = index, .iterations = 2, .wall_seconds = seconds, .cpu_seconds = seconds / 2, .phases = {}};
}

CellResult result_of(const Cell& cell) {
  CellResult result{.cell = cell, .repetitions = {}, .facts = {}};
  for (unsigned i = 0; i < 3; ++i) result.repetitions.push_back(repetition(i, 0.5 + 0.25 * i));
  result.facts["rays"] = 1000, result.facts["triangles"] = 500, result.facts["hits"] = 700,
  result.facts["wrong_answers"] = 0;
  return result;
}

}  // namespace

TEST_CASE("the journal gives back what it was told, and refuses another configuration") {
  const Folder folder;
  const Registry registry = paper_registry();
  Plan plan = make_plan(read_experiment(folder.write("small.yaml", kSmall), registry), registry);
  REQUIRE(plan.cells.size() == 2);
  const std::string first = plan.cells[0].name(), second = plan.cells[1].name();
  {
    Journal journal(folder.path(), "hash", plan, false);
    journal.add(first, repetition(0, 1.0));
    journal.finish(result_of(plan.cells[0]));
    journal.add(second, repetition(2, 3.0));
    journal.add(second, repetition(0, 2.0));
  }
  std::ofstream(folder.path() / "repetitions.jsonl", std::ios::app) << "{\"name\":\"torn";
  {
    Journal journal(folder.path(), "hash", plan, true);
    REQUIRE(journal.done().size() == 1);
    const CellResult& done = journal.done().at(first);
    CHECK(done.repetitions.size() == 3);
    CHECK(done.repetitions[2].wall_seconds == 1.0);
    CHECK(done.facts == result_of(plan.cells[0]).facts);
    const auto started = journal.started(second);
    REQUIRE(started.size() == 2);
    CHECK((started[0].index == 0 && started[1].index == 2));
  }
  CHECK(error_of([&] { Journal(folder.path(), "other", plan, true); }).find("another configuration") !=
        std::string::npos);
  std::ofstream(folder.path() / "repetitions.jsonl", std::ios::app) << "{\"name\":\"damag\n";
  CHECK_THAT(error_of([&] { Journal(folder.path(), "hash", plan, true); }),
             Catch::Contains("repetitions.jsonl:4: not a line as `run` writes it: no JSON object; take the line out"));
  CHECK(Journal(folder.path(), "other", plan, false).done().empty());
}

TEST_CASE("the configuration of a folder and its files of points are told by what they were written with") {
  const Folder folder;
  CHECK(hash_of_configuration(folder.path()).empty());
  folder.write("effective.yaml", std::string(kConfigurationHashHead) + "0123456789abcdef\n# shard: 1/2\n");
  CHECK(hash_of_configuration(folder.path()) == "0123456789abcdef");
  folder.write("effective.yaml", "experiment: small\n");
  CHECK(hash_of_configuration(folder.path()).empty());
  CHECK(is_seen_points_file(seen_points_file("bunny:size=100")));
  CHECK_FALSE(is_seen_points_file("camera_edges-bunny.json.part"));
  CHECK_FALSE(is_seen_points_file("results.json"));
}

TEST_CASE("a damaged line of a journal is named by file and line") {
  const Registry registry = paper_registry();
  for (const char* line : {"{\"name\": 5, \"configuration_hash\": \"hash\"}", "{\"name\": \"x\"}", "{}"}) {
    const Folder folder;
    const Plan plan = make_plan(read_experiment(folder.write("small.yaml", kSmall), registry), registry);
    Journal(folder.path(), "hash", plan, false).finish(result_of(plan.cells[0]));
    std::ofstream(folder.path() / "cells.jsonl", std::ios::app) << line << "\n";
    CHECK(error_of([&] { Journal(folder.path(), "hash", plan, true); }).find("cells.jsonl:2: not a line as `run`") !=
          std::string::npos);
  }
}

TEST_CASE("words of a command line are quoted where a shell would read them otherwise, and read back") {
  const std::vector<std::string> words{"run", "a.yaml", "isa=sse,avx2", "two words", "a|b", "it's", "", "$x", "\\d"};
  CHECK(shell_line(words) == R"(run a.yaml isa=sse,avx2 'two words' 'a|b' 'it'\''s' '' '$x' '\d')");
  CHECK(shell_split(shell_line(words)) == words);
  CHECK(shell_split("a  b").size() == 2);
}

TEST_CASE("results.json has what Google Benchmark's compare.py reads; the verdict follows the answers") {
  const Folder folder;
  const Registry registry = paper_registry();
  Plan plan = make_plan(read_experiment(folder.write("small.yaml", kSmall), registry), registry);
  plan.skipped.push_back({"some/cell", "no avx512"});
  RunOutcome outcome;
  for (const Cell& cell : plan.cells) outcome.results.push_back(result_of(cell));
  const Json document = Json::parse(results_json(outcome, plan, Json::object()));
  REQUIRE(document["benchmarks"].size() == 2 * (3 + 4));
  const Json& first = document["benchmarks"][7];  // the trace cell's first repetition
  CHECK(first["name"] == plan.cells[1].name());
  CHECK(first["run_name"] == first["name"]);
  CHECK(first["run_type"] == "iteration");
  CHECK(first["repetitions"] == 3);
  CHECK(first["real_time"].get<double>() == Approx(250.0));
  CHECK(first["cpu_time"].get<double>() == Approx(125.0));
  CHECK(first["time_unit"] == "ms");
  CHECK(first["rays_per_second"].get<double>() == Approx(4000.0));
  CHECK(first["rays_per_cpu_second"].get<double>() == Approx(8000.0));
  CHECK(first["structure"] == "tree");
  CHECK(first["threads"] == 1);
  const Json& median_entry = document["benchmarks"][11];
  CHECK(median_entry["run_type"] == "aggregate");
  CHECK(median_entry["aggregate_name"] == "median");
  CHECK(median_entry["name"] == plan.cells[1].name() + "_median");
  CHECK(document["skipped"][0]["reason"] == "no avx512");
  CHECK(results_csv(outcome).starts_with("name,run_name,run_type"));

  CHECK(verdict(outcome).first == ExitStatus::kDone);
  outcome.results[1].facts["wrong_answers"] = 2;
  CHECK(verdict(outcome).first == ExitStatus::kWrongAnswers);
  CHECK(verdict({}).first == ExitStatus::kNothingMeasured);
}

TEST_CASE("tables and results say what stands beside a median: an interval, a range, nothing") {
  const Folder folder;
  const Registry registry = paper_registry();
  const Plan plan = make_plan(read_experiment(folder.write("small.yaml", kSmall), registry), registry);
  for (const auto& [repetitions, name, words] : {std::tuple{1u, "interval", "of one repetition, which has no interval"},
                                                 {2u, "range", "range of 2 repetitions, which covers it 50 times"},
                                                 {5u, "range", "range of 5 repetitions, which covers it 94 times"},
                                                 {7u, "95 %", "median with its 95 % interval"}}) {
    RunOutcome outcome;
    for (const Cell& cell : plan.cells) {
      CellResult& result = outcome.results.emplace_back(result_of(cell));
      result.repetitions.clear();
      for (unsigned i = 0; i < repetitions; ++i) result.repetitions.push_back(repetition(i, 0.5 + 0.25 * i));
    }
    INFO(repetitions << " repetitions");
    for (bool trace : {true, false}) {
      if (!trace) std::erase_if(outcome.results, [](const CellResult& r) { return r.is_trace(); });
      const std::string text = result_tables(outcome);
      INFO(text);
      CHECK(text.find(words) != std::string::npos);
      CHECK(text.find(name) != std::string::npos);
      CHECK((text.find('[') != std::string::npos) == (repetitions > 1));
      const Json entry = aggregate_entries(outcome.results.front())[1];
      CHECK(entry["aggregate_name"] == "median");
      CHECK(entry.contains("triangles_per_second_low") == (repetitions > 1));
    }
  }
}

TEST_CASE("one table has one clock, that of the report: wall time where a cell has several threads") {
  const Folder folder;
  const Registry registry = paper_registry();
  const std::string sweep = std::string(kSmall) + "metrics: [trace]\n";
  const Experiment experiment = read_experiment(folder.write("small.yaml", sweep), registry);
  RunOutcome outcome;
  for (const Cell& cell : make_plan(experiment, registry).cells) outcome.results.push_back(result_of(cell));
  REQUIRE(outcome.results.size() == 1);
  const std::string one = result_tables(outcome);  // 1000 rays in 0.1875 s of CPU, 0.375 s of wall time
  INFO(one);
  CHECK(one.find("Mray/s CPU") != std::string::npos);
  CHECK(one.find("by thread CPU time") != std::string::npos);
  outcome.results[0].facts["rays"] = 375'000'000;
  CHECK(result_tables(outcome).find(" 2000.00 ") != std::string::npos);
  CellResult two = outcome.results[0];
  two.cell.threads = 2;
  outcome.results.push_back(two);
  const std::string several = result_tables(outcome);
  INFO(several);
  CHECK(several.find("Mray/s wall") != std::string::npos);
  CHECK(several.find("CPU") == std::string::npos);
  CHECK(several.find(" 1000.00 ") != std::string::npos);
  CHECK(several.find(" 2000.00 ") == std::string::npos);
}

TEST_CASE("warnings: repetitions that lie apart, however few; a camera that looks past the scene") {
  const Folder folder;
  const Registry registry = paper_registry();
  const Plan plan = make_plan(read_experiment(folder.write("small.yaml", kSmall), registry), registry);
  const auto warned = [&](const std::vector<double>& seconds, std::size_t hits, const char* part,
                          const std::vector<std::size_t>& cells = {1}) {
    RunOutcome outcome;
    for (std::size_t cell : cells) {
      CellResult& result = outcome.results.emplace_back(result_of(plan.cells[cell]));
      result.facts["hits"] = hits;
      result.repetitions.clear();
      for (unsigned i = 0; i < seconds.size(); ++i) result.repetitions.push_back(repetition(i, seconds[i]));
    }
    const std::vector<std::string> warnings = run_warnings(outcome, plan, 4);
    return std::ranges::any_of(warnings, [&](const std::string& w) { return w.find(part) != std::string::npos; });
  };
  for (const std::vector<double>& apart :
       {std::vector{1.0, 1.1}, {1.0, 1.0, 1.1}, {1.0, 1.0, 1.0, 1.0, 1.2}, {1.0, 0.9, 1.1, 0.8, 1.2, 1.05, 0.95}})
    CHECK(warned(apart, 1, "noisy machine: the repetitions of 1 of 1 cell spread by more than 5 %"));
  for (const std::vector<double>& near :
       {std::vector{1.0}, {1.0, 1.02}, {1.0, 1.02, 0.99}, {1.0, 1.0, 1.01, 1.0, 1.0, 1.0, 1.9}})
    CHECK(!warned(near, 1, "noisy"));
  CHECK(warned({1.0, 1.1}, 1, "; raise min_time or repetitions, or free the machine"));
  // Builds last no longer for a longer min_time.
  REQUIRE(plan.cells[0].metric == Cell::Metric::build);
  CHECK(warned({1.0, 1.1}, 1, "; raise repetitions, or free the machine", {0}));
  CHECK(warned({1.0, 1.1}, 1, "; raise min_time (builds heed it little) or repetitions, or free", {0, 1}));
  CHECK(warned({1.0}, 0, "none of the 1000 primary rays hits sphere-500: its camera looks past it"));
  CHECK(!warned({1.0}, 1, "looks past it"));
}

TEST_CASE("u and v that are off on most hits are told, whatever the wrong answers") {
  const Folder folder;
  const Registry registry = paper_registry();
  const Plan plan = make_plan(read_experiment(folder.write("small.yaml", kSmall), registry), registry);
  AnswerCheck check;
  check.uv_error_median = kWrongUv, check.uv_error_max = 1.0, check.wrong_uv = 400;
  RunOutcome outcome;
  outcome.results.push_back(result_of(plan.cells[1]));
  const auto warnings = [&] {
    add_facts(outcome.results[0].facts, check, true);
    std::vector<std::string> lines = run_warnings(outcome, plan, 64);
    std::erase_if(lines, [](const std::string& line) { return line.find("u or v") == std::string::npos; });
    return lines;
  };
  CHECK(warnings().empty());
  check.uv_error_median = 0.25;
  REQUIRE(warnings().size() == 1);
  CHECK(warnings()[0] == "u or v of most hits is off by more than 2^-10 in 1 of 1 cell (first: " +
                             plan.cells[1].name() + "): u is to weigh the triangle's second corner, v its third");
  CHECK(outcome.results[0].facts["wrong_uv"] == 400);
  CHECK(outcome.results[0].facts["uv_error_max"] == 1.0);
  CHECK(outcome.results[0].facts["wrong_answers"] == 0);
}

TEST_CASE(
    "the warning of noise is by the clock of the tables: wall time of builds, and beside cells of several threads") {
  const Folder folder;
  const Registry registry = paper_registry();
  const Plan plan = make_plan(read_experiment(folder.write("small.yaml", kSmall), registry), registry);
  const auto warned = [&](const Cell& cell, bool wall_spreads, unsigned threads_beside) {
    RunOutcome outcome;
    CellResult& result = outcome.results.emplace_back(result_of(cell));
    for (Repetition& r : result.repetitions) {
      const double spread = 1.0 + 0.2 * r.index;
      r.wall_seconds = wall_spreads ? spread : 1.0, r.cpu_seconds = wall_spreads ? 1.0 : spread;
    }
    CellResult beside = result_of(plan.cells[1]);
    for (Repetition& r : beside.repetitions) r.wall_seconds = r.cpu_seconds = 1.0;
    beside.cell.threads = threads_beside;
    outcome.results.push_back(beside);
    const std::vector<std::string> warnings = run_warnings(outcome, plan, 4);
    return std::ranges::any_of(warnings,
                               [](const std::string& w) { return w.find("1 of 2 cells") != std::string::npos; });
  };
  const Cell &build = plan.cells[0], &trace = plan.cells[1];
  REQUIRE((build.metric == Cell::Metric::build && trace.metric == Cell::Metric::trace));
  for (unsigned threads : {1u, 2u}) {
    CHECK(warned(build, true, threads));
    CHECK_FALSE(warned(build, false, threads));
    CHECK(warned(trace, true, threads) == (threads == 2));
    CHECK(warned(trace, false, threads) == (threads == 1));
  }
}

TEST_CASE("wrong answers are of the rays that were checked, which of renderers are not those that were timed") {
  const Folder folder;
  const Registry registry = paper_registry();
  const Plan plan = make_plan(read_experiment(folder.write("small.yaml", kSmall), registry), registry);
  RunOutcome outcome;
  for (const char* workload : {"path", "primary"})
    outcome.results.push_back(result_of(plan.cells[1])), outcome.results.back().cell.workload = workload;
  outcome.results[0].facts["checked_rays"] = 100, outcome.results[0].facts["wrong_answers"] = 1;
  outcome.results[1].facts["wrong_answers"] = 4;  // of 1000
  const std::string text = result_tables(outcome);
  INFO(text);
  CHECK(text.find(" 10000.0 ") != std::string::npos);
  CHECK(text.find(" 4000.0 ") != std::string::npos);
  const std::string why = verdict(outcome).second;
  INFO(why);
  CHECK(why.find("most: 1 of 100 rays in " + outcome.results[0].cell.name()) != std::string::npos);
}

TEST_CASE("nothing to interleave is nothing to say") {
  std::ostringstream said;
  std::streambuf* const before = std::cerr.rdbuf(said.rdbuf());
  run_interleaved({});
  run_interleaved({{.name = "done before", .indices = {}, .measure = {}, .ended = {}}});
  std::cerr.rdbuf(before);
  CHECK(said.str().empty());
}

TEST_CASE("what is slow or small is not 0 in a table") {
  CHECK(figure(1234.567, 2) == "1234.57");
  CHECK(figure(1.0, 2) == "1.00");
  CHECK(figure(0.1234, 2) == "0.123");
  CHECK(figure(0.00123456, 2) == "0.00123");
  CHECK(figure(-0.00123456, 2) == "-0.00123");
  CHECK(figure(0.0, 1) == "0.0");
  CHECK(figure(0.04, 1) == "0.0400");
  CHECK(figure(1e-30, 2) == "1.00e-30");
  const Folder folder;
  const Registry registry = paper_registry();
  const Plan plan = make_plan(read_experiment(folder.write("small.yaml", kSmall), registry), registry);
  RunOutcome outcome;
  outcome.results.push_back(result_of(plan.cells[1]));
  const std::string text = result_tables(outcome);  // 1000 rays in 0.125, 0.1875 and 0.25 s
  INFO(text);
  CHECK(text.find(" 0.00533  [0.00400, 0.00800] ") != std::string::npos);
}

TEST_CASE("one of a thing is one") {
  CHECK(counted(1, "cell") == "1 cell");
  CHECK(counted(0, "cell") == "0 cells");
  CHECK(counted(12, "cell") == "12 cells");
  const Folder folder;
  const Registry registry = paper_registry();
  Plan plan = make_plan(read_experiment(folder.write("small.yaml", kSmall), registry), registry);
  plan.skipped.push_back({"some/cell", "no avx512"});
  CHECK(skipped_lines(plan, {}).starts_with("1 combination skipped:\n"));
  RunOutcome outcome;
  outcome.results.push_back(result_of(plan.cells[1]));
  CHECK(verdict(outcome).second == "1 cell measured, all answers right");
}

TEST_CASE("what Embree's package costs its streams is said where there are some") {
  const Folder folder;
  const Registry registry = paper_registry();
  const Plan plan = make_plan(read_experiment(folder.write("small.yaml", kSmall), registry), registry);
  for (const auto& [structure, traversal, said] :
       {std::tuple{"embree", "stream_coherent", true}, {"embree", "single", false}, {"bvh8", "stream", false}}) {
    RunOutcome outcome;
    CellResult& result = outcome.results.emplace_back(result_of(plan.cells[1]));
    result.cell.structure = structure, result.cell.traversal = traversal;
    CHECK((result_tables(outcome).find("keeps its assertions on") != std::string::npos) == said);
  }
}

TEST_CASE("Google Benchmark's flags: ours are taken, wrong ones are named") {
  std::vector<std::string> words{"run",
                                 "a.yaml",
                                 "--benchmark_repetitions=3",
                                 "--benchmark_min_time=0.5s",
                                 "--benchmark_min_warmup_time=0.1",
                                 "--benchmark_filter=bvh8",
                                 "--benchmark_context=host=a,note=x=y",
                                 "--benchmark_enable_random_interleaving=no"};
  const BenchmarkFlags flags = take_benchmark_flags(words);
  CHECK(words == std::vector<std::string>{"run", "a.yaml"});
  CHECK(flags.repetitions == 3u);
  CHECK(flags.min_time == 0.5);
  CHECK(flags.filter == "bvh8");
  CHECK(flags.min_warmup_time == 0.1);
  CHECK(flags.context == std::vector<std::pair<std::string, std::string>>{{"host", "a"}, {"note", "x=y"}});
  CHECK(flags.others == std::vector<std::string>{"--benchmark_enable_random_interleaving=false"});
  std::vector<std::string> negated{"--benchmark_filter=-bvh8"}, all{"--benchmark_filter=all"};
  CHECK(take_benchmark_flags(negated).skip == "bvh8");
  CHECK((take_benchmark_flags(all).filter.empty() && take_benchmark_flags(all).skip.empty()));
  for (const auto& [flag, part] : {std::pair{"--benchmark_v=1", "unknown flag of Google Benchmark '--benchmark_v'"},
                                   {"--benchmark_min_tim=1", "did you mean '--benchmark_min_time'"},
                                   {"--benchmark_color=true", "no effect"},
                                   {"--benchmark_counters_tabular=true", "no effect"},
                                   {"--benchmark_perf_counters=CYCLES", "no effect"},
                                   {"--benchmark_time_unit=us", "add --benchmark_out"},
                                   {"--benchmark_time_unit=hours", "one of ns, us, ms, s"},
                                   {"--benchmark_report_aggregates_only", "add --benchmark_out"},
                                   {"--benchmark_display_aggregates_only=true", "add --benchmark_format"},
                                   {"--benchmark_out_format=csv", "without --benchmark_out"},
                                   {"--benchmark_enable_random_interleaving=perhaps", "one of true, false"},
                                   {"--benchmark_context=foo", "key=value"},
                                   {"--benchmark_context==x", "key=value"},
                                   {"--benchmark_context=a=1,a=2", "given twice"}}) {
    std::vector<std::string> one{flag};
    CHECK(error_of([&] { (void)take_benchmark_flags(one); }).find(part) != std::string::npos);
  }
  std::vector<std::string> twice{"--benchmark_filter=a", "--benchmark_filter=b"};
  CHECK(error_of([&] { (void)take_benchmark_flags(twice); }).find("given twice") != std::string::npos);
  std::vector<std::string> wrong{"--benchmark_repetitions=many"};
  CHECK(error_of([&] { (void)take_benchmark_flags(wrong); }).find("a number from 1") != std::string::npos);
  std::vector<std::string> format{"--benchmark_format=xml"};
  CHECK(error_of([&] { (void)take_benchmark_flags(format); }).find("one of console, json, csv") != std::string::npos);
}

TEST_CASE("interleaved jobs run each of their repetitions once, and an error comes out") {
  initialize_benchmark({});
  std::map<std::string, std::vector<unsigned>> ended;
  std::map<std::string, int> loops;
  std::vector<InterleavedJob> jobs;
  for (const char* name : {"a/b:1", "c"}) {
    jobs.push_back({.name = name,
                    .indices = {0, 2, 5},
                    .iterations = 4,
                    .measure =
                        [&loops, name](TimedLoop& loop) {
                          while (loop.next()) ++loops[name];
                          return Repetition{};
                        },
                    .ended = [&ended, name](const Repetition& r) { ended[name].push_back(r.index); }});
  }
  run_interleaved(jobs);
  CHECK(ended["a/b:1"] == std::vector<unsigned>{0, 2, 5});
  CHECK(ended["c"] == std::vector<unsigned>{0, 2, 5});
  CHECK(loops["a/b:1"] == 12);
  jobs[0].ended = [](const Repetition&) { throw UserError("disk full"); };
  CHECK(error_of([&] { run_interleaved(jobs); }) == "disk full");
  CHECK_THROWS_AS(initialize_benchmark({"--benchmark_nonsense=1"}), UserError);
}
