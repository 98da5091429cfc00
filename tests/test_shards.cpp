// Shards are the plan, cut the same everywhere; merged they are the whole run; what does not belong together is
// refused.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "experiments/append_file.h"
#include "experiments/effective.h"
#include "experiments/journal.h"
#include "experiments/merge.h"
#include "experiments/results_writer.h"
#include "experiments/shard.h"
#include "experiments/summary.h"
#include "tests/catch.h"
#include "tests/experiments_on_paper.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

constexpr const char* kSweep = R"(
scenes: [{generate: sphere, triangles: 500}, {generate: sphere_flake, triangles: 100000}]
axes: {structure: [tree, list], builder: [binned_sah, morton, none], isa: [sse, avx2, avx512], intersector: [moller_trumbore, watertight], traversal: [single, packet8], workload: [primary, diffuse]}
)";

std::set<std::string> all_names(const Plan& plan) {
  std::set<std::string> names;
  for (const Cell& cell : plan.cells) names.insert(cell.name());
  for (const SkippedCell& cell : plan.skipped) names.insert(cell.name);
  return names;
}

struct Sweep {
  Folder folder;
  Registry registry;
  Experiment experiment;
  Plan plan;
  explicit Sweep(std::vector<Isa> isas = {Isa::scalar, Isa::sse, Isa::avx2}, const std::string& yaml = kSweep)
      : registry(paper_registry(std::move(isas))),
        experiment(read_experiment(folder.write("sweep.yaml", yaml), registry)), plan(make_plan(experiment, registry)) {
  }

  Plan shard(unsigned index, unsigned of) const {
    Plan part = plan;
    keep_shard(part, split_plan(experiment, plan, of), index);
    return part;
  }
};

CellResult result_of(const Cell& cell) {
  CellResult result{.cell = cell,
                    .repetitions = {},
                    .facts = {{"rays", 1000}, {"triangles", 500}, {"wrong_answers", 0}, {"sah_cost", 20.25}}};
  for (unsigned i = 0; i < 3; ++i)
    result.repetitions.push_back({.index = i,
                                  .iterations = 3,
                                  .wall_seconds = 0.1 + 0.01 * i,
                                  .cpu_seconds = 0.1,
                                  .phases = {{"collapse", 0.02}}});
  return result;
}

Json machine() {
  return {{"cpu", "a processor"},    {"cores", 2},
          {"isa", {"sse", "avx2"}},  {"compiler", "GNU"},
          {"compiler_flags", "-O3"}, {"git_revision", "0123456789abcdef"},
          {"git_dirty", false},      {"command", "arboretum run sweep.yaml --shard 1/2 --out x"}};
}

/// What `run` leaves of a shard; `most`: it was cut off after so many cells.
fs::path write_part(const Sweep& sweep, const std::string& name, const Shard& shard, const Json& context = machine(),
                    std::size_t most = SIZE_MAX) {
  const fs::path folder = sweep.folder.path() / name;
  fs::create_directories(folder);
  const std::string hash = configuration_hash(sweep.experiment);
  const std::map<std::string, unsigned> shards = split_plan(sweep.experiment, sweep.plan, shard.of);
  PlanRecord record = record_of(sweep.plan, shards, shard);
  record.context = context;
  write_whole(folder / kPlanFile, to_text(record));
  write_whole(folder / "effective.yaml", "# configuration hash: " + hash + "\n" + effective_yaml(sweep.experiment));
  Plan part = sweep.plan;
  if (!shard.is_whole()) keep_shard(part, shards, shard.index);
  RunOutcome outcome;
  Journal journal(folder, hash, part, false);
  for (const Cell& cell : part.cells) {
    if (outcome.results.size() == most) return folder;
    outcome.results.push_back(result_of(cell));
    journal.finish(outcome.results.back());
  }
  write_whole(folder / "results.json", results_json(outcome, part, context));
  return folder;
}

Merged merged(const std::vector<fs::path>& folders, const MergeOptions& options = {}) {
  std::vector<ResultFolder> parts;
  for (const fs::path& folder : folders) parts.push_back(read_result_folder(folder));
  return merge_folders(parts, options, "arboretum merge");
}

}  // namespace

TEST_CASE("shards together are the plan, each cell once, skipped ones too") {
  const Sweep sweep;
  const std::set<std::string> whole = all_names(sweep.plan);
  REQUIRE(sweep.plan.cells.size() > 40);
  REQUIRE(sweep.plan.skipped.size() > 20);
  for (unsigned of : {1u, 2u, 3u, 4u, 7u, 16u, 1000u}) {
    std::set<std::string> seen;
    std::size_t cells = 0, total = 0;
    for (unsigned index = 1; index <= of; ++index) {
      const Plan part = sweep.shard(index, of);
      CHECK(part.cells.size() + part.in_other_shards == sweep.plan.cells.size());
      cells += part.cells.size(), total += part.cells.size() + part.skipped.size();
      seen.merge(all_names(part));
    }
    CHECK(cells == sweep.plan.cells.size());
    CHECK(total == whole.size());
    CHECK(seen == whole);
  }
}

TEST_CASE("shards are the same on machines that lack an instruction set") {
  const Sweep least({Isa::scalar}), some, all({Isa::scalar, Isa::sse, Isa::avx2, Isa::avx512});
  CHECK(least.plan.cells.empty());
  CHECK(all.plan.elsewhere.empty());
  for (const Sweep* sweep : {&least, &some}) {
    for (unsigned of : {2u, 5u, 9u}) {
      const auto here = split_plan(sweep->experiment, sweep->plan, of),
                 there = split_plan(all.experiment, all.plan, of);
      CHECK(here == there);
    }
  }
}

TEST_CASE("shards are of about equal time, and keep a structure's cells together where they can") {
  const Sweep sweep({Isa::scalar, Isa::sse, Isa::avx2, Isa::avx512}, std::string(kSweep) + "metrics: [trace]\n");
  const std::map<std::string, unsigned> shards = split_plan(sweep.experiment, sweep.plan, 4);
  std::map<unsigned, std::size_t> sizes;
  std::map<std::string, std::set<unsigned>> of_structure;
  for (const Cell& cell : sweep.plan.cells) {
    ++sizes[shards.at(cell.name())];
    of_structure[cell.scene + cell.structure + cell.builder + cell.leaf].insert(shards.at(cell.name()));
  }
  REQUIRE(sizes.size() == 4);
  for (const auto& [shard, size] : sizes) {
    CHECK(size >= sweep.plan.cells.size() / 4 * 3 / 4);
    CHECK(size <= sweep.plan.cells.size() / 4 * 5 / 4 + 1);
  }
  const auto split = std::ranges::count_if(of_structure, [](const auto& entry) { return entry.second.size() > 1; });
  CHECK(split <= 3);  // three cuts
}

TEST_CASE("a filter comes before the split: shards share what is left") {
  Sweep sweep;
  apply_filter(sweep.plan, "watertight", "");
  const Plan one = sweep.shard(1, 2), two = sweep.shard(2, 2);
  CHECK(!one.cells.empty());
  CHECK(!two.cells.empty());
  CHECK(one.cells.size() + two.cells.size() == sweep.plan.cells.size());
}

TEST_CASE("shards that make no sense are one line") {
  CHECK(parse_shard("2/8") == Shard{2, 8});
  CHECK(parse_shard("1/1").is_whole());
  for (const char* text : {"", "/", "1", "1/", "/2", "0/2", "3/2", "-1/2", "1/2/3", "1/2 ", " 1/2", "1.5/2", "a/b",
                           "1/0", "1/100001", "99999999999/99999999999"})
    CHECK(error_of([&] { (void)parse_shard(text); }).find("as in --shard 2/8") != std::string::npos);
}

TEST_CASE("merged shards are the whole run's results") {
  const Sweep sweep;
  const ResultFolder whole = read_result_folder(write_part(sweep, "whole", {}));
  std::vector<fs::path> parts;
  for (unsigned i = 1; i <= 3; ++i) parts.push_back(write_part(sweep, "part" + std::to_string(i), {i, 3}));
  std::swap(parts[0], parts[2]);  // the order of the parts is no matter
  const Merged all = merged(parts);
  CHECK(all.missing.empty());
  CHECK(missing_line(all).empty());
  RunOutcome outcome;
  for (const CellResult& r : whole.cells) outcome.results.push_back(r);
  const Json expected = Json::parse(results_json(outcome, sweep.plan, {})),
             found = Json::parse(results_json(all.outcome, all.plan, {}));
  CHECK(found["benchmarks"] == expected["benchmarks"]);
  CHECK(found["skipped"] == expected["skipped"]);
  CHECK(found["context"]["skipped_cells"] == expected["context"]["skipped_cells"]);
  CHECK(results_csv(all.outcome) == results_csv(outcome));
  CHECK(all.lines == whole.lines);
  CHECK(all.context["command"] == "arboretum run sweep.yaml");
  CHECK(!all.context.contains("shard"));
  CHECK(all.context["merged_from"].size() == 3);
  CHECK(verdict(all.outcome).first == ExitStatus::kDone);
}

TEST_CASE("what is missing of a merge is known by name; a run that was cut off gives what it has") {
  const Sweep sweep;
  const fs::path one = write_part(sweep, "one", {1, 3}), two = write_part(sweep, "two", {2, 3}, machine(), 5);
  const Merged some = merged({one, two});
  CHECK(some.outcome.results.size() == sweep.shard(1, 3).cells.size() + 5);
  CHECK(some.outcome.results.size() + some.missing.size() == sweep.plan.cells.size());
  const std::string line = missing_line(some);
  CHECK(line.find(fmt::format("{} of shard 2/3, {} of shard 3/3", sweep.shard(2, 3).cells.size() - 5,
                              sweep.shard(3, 3).cells.size())) != std::string::npos);
  CHECK(Json::parse(results_json(some.outcome, some.plan, {}))["missing"].size() == some.missing.size());
  // Known from plan.json, whoever would have reported them
  CHECK(some.plan.skipped.size() == sweep.plan.skipped.size());
}

TEST_CASE("parts that do not belong together are refused, or merged when told to") {
  const Sweep sweep;
  const fs::path one = write_part(sweep, "one", {1, 2});
  Sweep other_sweep({Isa::scalar, Isa::sse, Isa::avx2}, std::string(kSweep) + "measure: {repetitions: 9}\n");
  const std::string configuration = error_of([&] { (void)merged({one, write_part(other_sweep, "other", {2, 2})}); });
  CHECK(configuration.find("different configurations") != std::string::npos);
  CHECK(configuration.find("repetitions: 9") != std::string::npos);
  // Neither an empty line nor the shorter file hides the first difference.
  const fs::path other = other_sweep.folder.path() / "other";
  const auto told = [&](const std::string& of_one, const std::string& of_other) {
    write_whole(one / "effective.yaml", of_one), write_whole(other / "effective.yaml", of_other);
    return error_of([&] { (void)merged({one, other}); });
  };
  CHECK(told("a: 1\n\nb: 2\n", "a: 1\nb: 3\n").find("differ in `b: 2` against `b: 3`") != std::string::npos);
  CHECK(told("a: 1\n", "a: 1\n  b: 3\n").find("other alone has `b: 3`") != std::string::npos);
  CHECK(told("a: 1\n  b: 3\n", "a: 1\n").find("one alone has `b: 3`") != std::string::npos);
  write_part(sweep, "one", {1, 2});

  Json elsewhere = machine();
  elsewhere["cpu"] = "another processor";
  const fs::path far = write_part(sweep, "far", {2, 2}, elsewhere);
  CHECK(error_of([&] {
          (void)merged({one, far});
        }).find("CPU: a processor against another processor") != std::string::npos);
  const Merged mixed = merged({one, far}, {.allow_different_machines = true});
  CHECK(mixed.context["cpu"] == "a processor | another processor");
  CHECK(mixed.outcome.warnings.at(0).find("different machines") != std::string::npos);
  CHECK(mixed.outcome.results.front().facts["part"].get<int>() +
            mixed.outcome.results.back().facts["part"].get<int>() ==
        3);

  Json later = machine();
  later["git_revision"] = "fedcba9876543210";
  const fs::path newer = write_part(sweep, "newer", {2, 2}, later);
  CHECK(error_of([&] { (void)merged({one, newer}); }).find("revision 0123456789ab") != std::string::npos);
  CHECK(merged({one, newer}, {.allow_different_revisions = true}).missing.empty());

  const std::string doubled = error_of([&] { (void)merged({one, write_part(sweep, "again", {1, 2})}); });
  CHECK(doubled.find("is in both") != std::string::npos);
  CHECK(doubled.find("more") != std::string::npos);
}

TEST_CASE("a folder that holds no results names the nearest that does; damaged files are named") {
  const Sweep sweep;
  const fs::path part = write_part(sweep, "shard-one", {1, 2});
  CHECK(error_of([&] { (void)read_result_folder(sweep.folder.path() / "shard-onw"); }).find("shard-one'") !=
        std::string::npos);
  CHECK(error_of([&] { (void)read_result_folder(sweep.folder.path()); }).find("shard-one'") != std::string::npos);
  CHECK(error_of([&] { (void)read_result_folder(part / "results.json"); }).find("give the folder") !=
        std::string::npos);
  std::ofstream(part / "cells.jsonl", std::ios::app) << "{\"name\": \"torn";  // by a kill
  CHECK(read_result_folder(part).cells.size() == sweep.shard(1, 2).cells.size());
  std::ofstream(part / "cells.jsonl", std::ios::app) << "\nno json\n";
  CHECK(error_of([&] { (void)read_result_folder(part); }).find("cells.jsonl:") != std::string::npos);
  // results.json alone is enough to compare.
  fs::remove(part / "cells.jsonl");
  const ResultFolder alone = read_result_folder(part);
  REQUIRE(alone.cells.size() == sweep.shard(1, 2).cells.size());
  CHECK(alone.cells[0].repetitions[2].wall_seconds == Approx(0.12));
  CHECK(alone.cells[0].fact("rays") == 1000.0);
  CHECK(error_of([&] { (void)merge_folders({alone}, {}, ""); }).find("no cells.jsonl") != std::string::npos);
  write_whole(part / "results.json", "{");
  CHECK(error_of([&] { (void)read_result_folder(part); }).find("results.json") != std::string::npos);
}

TEST_CASE("a run gone on with keeps what was measured, whatever its filter, its shard and its machine") {
  const Sweep before({Isa::scalar, Isa::sse, Isa::avx2, Isa::avx512}), here;
  std::map<std::string, CellResult> done;
  for (const Cell& cell : before.plan.cells)
    if (cell.isa != Isa::sse) done.emplace(cell.name(), result_of(cell));
  done.emplace("of/another/experiment", result_of(before.plan.cells[0]));
  for (const unsigned of : {1u, 3u}) {
    CAPTURE(of);
    Plan plan = here.plan;
    apply_filter(plan, "watertight.*sse", "");
    const std::size_t filtered = plan.filtered;
    const auto shards = split_plan(here.experiment, plan, of);
    const Shard shard{.index = of, .of = of};
    PlanRecord record = record_of(plan, shards, shard);
    if (of > 1) keep_shard(plan, shards, of);
    std::set<std::string> wanted;
    for (const Cell& cell : plan.cells) wanted.insert(cell.name());
    REQUIRE((!wanted.empty() && filtered > 0));
    Plan unchanged = plan;
    PlanRecord same = record;
    keep_measured(unchanged, same, here.plan, {});
    CHECK(names(unchanged, Cell::Metric::trace) == names(plan, Cell::Metric::trace));
    CHECK(to_text(same) == to_text(record));
    CHECK(unchanged.filtered == filtered);

    keep_measured(plan, record, here.plan, done);
    std::vector<std::string> expected, found;
    for (const auto* list : {&here.plan.cells, &here.plan.elsewhere})
      for (const Cell& cell : *list)
        if (wanted.contains(cell.name()) || done.contains(cell.name())) expected.push_back(cell.name());
    for (const Cell& cell : plan.cells) found.push_back(cell.name());
    CHECK(found == expected);
    CHECK(std::ranges::count_if(plan.cells, [](const Cell& cell) { return cell.isa == Isa::avx512; }) > 0);
    CHECK(std::ranges::none_of(plan.skipped, [&](const SkippedCell& cell) { return done.contains(cell.name); }));
    CHECK(std::ranges::none_of(record.skipped,
                               [&](const PlanRecord::Entry& entry) { return done.contains(entry.name); }));
    std::map<std::string, unsigned> recorded;
    for (const PlanRecord::Entry& entry : record.cells) recorded.emplace(entry.name, entry.shard);
    for (const std::string& name : found) CHECK(recorded.at(name) == of);
    if (of == 1)
      CHECK(plan.filtered == filtered - std::size_t(std::ranges::count_if(
                                            here.plan.cells, [&](const Cell& c) { return done.contains(c.name()); })));
    CHECK(record.filtered == plan.filtered);
  }
}
