// Instances and motion in experiments: what the plan keeps and skips, cells by the structure below, a run of both, and
// its resumption.
#include <new>

#include "core/error.h"
#include "experiments/config.h"
#include "experiments/journal.h"
#include "experiments/plan.h"
#include "experiments/results_writer.h"
#include "experiments/runner.h"
#include "tests/catch.h"
#include "tests/scene_files.h"
#include "traversal/kernel_table.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

constexpr const char* kSweep = R"(
scenes: [{generate: forest, triangles: 3000}, {generate: waving_cloth, triangles: 600}]
axes: {structure: [bvh8, two_level, bvh4_motion], isa: [avx2], intersector: [watertight], workload: [primary, shadow]}
parameters: {below: [bvh4, brute_force, two_level, embree]}
measure: {repetitions: 2, warmup: 0, min_time: 0.001, resolution: [48, 32]}
)";

std::size_t with(const Plan& plan, const std::string& part) {
  std::size_t count = 0;
  for (const Cell& cell : plan.cells) count += cell.name().find(part) != std::string::npos;
  return count;
}

std::size_t skipped(const Plan& plan, const std::string& part, const std::string& reason) {
  std::size_t count = 0;
  for (const SkippedCell& cell : plan.skipped)
    count += cell.name.find(part) != std::string::npos && cell.reason.find(reason) != std::string::npos;
  return count;
}

}  // namespace

TEST_CASE("the plan knows what moves and what can stand below, and gives reasons") {
  const Folder folder;
  const Registry registry = this_registry();
  const Plan plan = make_plan(read_experiment(folder.write("sweep.yaml", kSweep), registry), registry);
  if (!registry.has(Isa::avx2)) return;
  // Of a structure that takes none below the parameter makes no cells of its own.
  CHECK(with(plan, "trace/forest-3000/bvh8/binned_sah/") == 2);
  CHECK(with(plan, "trace/forest-3000/two_level/binned_sah:below=bvh4/") == 2);
  CHECK(with(plan, "trace/forest-3000/two_level/in_order:below=brute_force/") == 2);
  CHECK(skipped(plan, "forest-3000/two_level/binned_sah:below=two_level/",
                "two_level over two_level: two_level stands above other structures") == 2);
  if (find_structure("embree"))
    CHECK(skipped(plan, "forest-3000/two_level/", "two_level over embree: embree is a library") == 2);
  CHECK(skipped(plan, "forest-3000/bvh4_motion/", "bvh4_motion is for moving scenes, and nothing moves") == 2);
  CHECK(with(plan, "trace/waving_cloth-600/bvh4_motion/") == 2);
  CHECK(skipped(plan, "waving_cloth-600/bvh8/", "bvh8 holds one moment, and the scene moves") == 2);
  CHECK(skipped(plan, "waving_cloth-600/two_level/", "two_level holds one moment, and the scene moves") > 0);
}

TEST_CASE("a cell that fails while it is made ready takes no other with it") {
  const Folder folder;
  Registry registry = this_registry();
  std::vector<KernelRow> rows(kernel_table().begin(), kernel_table().end());
  for (KernelRow& row : rows) {
    if (row.structure == "bvh2")
      row.timed.closest_hit = [](const Accel&, const KernelRow&, RayBatch, std::span<Hit>, Counters*) {
        throw UserError("this kernel cannot");
      };
    if (row.structure == "bvh4")
      row.timed.closest_hit = [](const Accel&, const KernelRow&, RayBatch, std::span<Hit>, Counters*) {
        throw std::bad_alloc();
      };
  }
  registry.kernels = rows;
  const Experiment experiment = read_experiment(folder.write("sweep.yaml", R"(
scenes: [{generate: sphere, triangles: 100}]
axes: {structure: [bvh2, bvh4, bvh8], isa: [scalar], intersector: [watertight], workload: [primary]}
measure: {repetitions: 2, warmup: 0, min_time: 0.001, resolution: [8, 8]}
metrics: [trace]
)"),
                                                registry);
  const Plan plan = make_plan(experiment, registry);
  REQUIRE(plan.cells.size() == 3);
  const auto run = [&](bool fail_fast) {
    Journal journal(folder.path(), "hash", plan, false);
    return run_plan(experiment, plan, registry, journal, {.fail_fast = fail_fast});
  };
  const RunOutcome outcome = run(false);
  CHECK(outcome.error.empty());
  REQUIRE(outcome.failed.size() == 2);
  CHECK(outcome.failed[0].name.find("/bvh2/") != std::string::npos);
  CHECK(outcome.failed[0].reason == "this kernel cannot");
  CHECK(outcome.failed[1].reason.find("out of memory") == 0);
  REQUIRE(outcome.results.size() == 1);
  CHECK(outcome.results[0].cell.structure == "bvh8");
  CHECK(outcome.results[0].repetitions.size() == 2);
  CHECK(run(true).error.find("this kernel cannot") != std::string::npos);
}

TEST_CASE("a scene that was loaded before its turn is not loaded again; whose turn it is not is let go") {
  const Folder folder;
  const Registry registry = this_registry();
  folder.write("triangle.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const auto read = [&](const std::string& scenes) {
    return read_experiment(folder.write("sweep.yaml", "scenes: " + scenes + R"(
axes: {structure: [bvh2], isa: [scalar], intersector: [watertight]}
measure: {repetitions: 1, warmup: 0, min_time: 0.001, resolution: [8, 8]}
metrics: [build]
)"),
                           registry);
  };
  const Experiment one = read("[{file: triangle.obj}]"),
                   two = read("[{generate: city, triangles: 1000}, {file: triangle.obj}]");
  const auto run = [&](const Experiment& experiment, LoadedScene loaded) {
    const Plan plan = make_plan(experiment, registry);
    Journal journal(folder.path(), "hash", plan, false);
    return run_plan(experiment, plan, registry, journal, {}, std::move(loaded));
  };
  const auto load = [](const Experiment& experiment, std::size_t index) {
    return LoadedScene{index, std::make_unique<SceneData>(experiment.scenes[index], experiment.measure)};
  };
  CHECK(run(two, load(two, 1)).results.size() == 2);
  LoadedScene only = load(one, 0), second = load(two, 1);
  fs::remove(folder.path() / "triangle.obj");
  const RunOutcome kept = run(one, std::move(only)), let_go = run(two, std::move(second)), not_loaded = run(one, {});
  CHECK(kept.error.empty());
  REQUIRE(kept.results.size() == 1);
  CHECK(kept.results[0].fact("triangles") == 1);
  CHECK(let_go.results.size() == 1);
  CHECK(let_go.error.find("triangle.obj") != std::string::npos);
  CHECK(not_loaded.error.find("triangle.obj") != std::string::npos);
  // What its loader has to say waits for someone to say it to.
  std::vector<std::string> notes;
  SceneData data(two.scenes[0], two.measure);
  data.note_to([&](const std::string& line) { notes.push_back(line); });
  REQUIRE(notes.size() == 1);
  CHECK(notes[0].starts_with("city-1000: "));
}

TEST_CASE("both are measured, journalled, resumed and written as CSV") {
  const Folder folder;
  const Registry registry = this_registry();
  if (!registry.has(Isa::avx2)) return;
  const Experiment experiment = read_experiment(folder.write("sweep.yaml", kSweep), registry);
  const Plan plan = make_plan(experiment, registry);
  RunOutcome outcome;
  {
    Journal journal(folder.path(), "hash", plan, false);
    outcome = run_plan(experiment, plan, registry, journal, {});
  }
  CHECK(outcome.error.empty());
  CHECK(outcome.failed.empty());
  REQUIRE(outcome.results.size() == plan.cells.size());
  std::size_t traced = 0;
  for (const CellResult& result : outcome.results) {
    INFO(result.cell.name());
    CHECK(result.repetitions.size() >= 2);
    CHECK(result.fact("bytes") > 0);
    CHECK(result.fact("sah_cost") > 0);
    if (!result.is_trace()) continue;
    ++traced;
    CHECK(result.fact("hits") > 50);
    CHECK(result.fact("wrong_answers") == 0);
    CHECK(result.fact("cracks") == 0);
    CHECK(result.fact("triangles_per_ray") > 0);
  }
  CHECK(traced == 8);
  const std::string csv = results_csv(outcome);
  CHECK(csv.find("bvh4_motion") != std::string::npos);
  CHECK(csv.find("in_order:below=brute_force") != std::string::npos);
  Journal again(folder.path(), "hash", plan, true);
  CHECK(again.done().size() == plan.cells.size());
}
