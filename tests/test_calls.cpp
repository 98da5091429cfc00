// The axis `call`: names and reasons in a plan, what a kernel is called with, and the same answers by every call.
#include "experiments/call_axis.h"

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "experiments/config.h"
#include "experiments/effective.h"
#include "experiments/plan.h"
#include "experiments/result.h"
#include "experiments/result_folder.h"
#include "experiments/scene_data.h"
#include "experiments/trace_job.h"
#include "experiments/verify_plan.h"
#include "tests/catch.h"
#include "tests/experiments_on_paper.h"
#include "tests/kernel_runner.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

Cell cell_of_call(std::string traversal, std::string call, std::string workload = "primary") {
  Cell cell;
  cell.traversal = std::move(traversal), cell.call = std::move(call), cell.workload = std::move(workload);
  return cell;
}

/// The rays of each call, and the row that answers them.
struct Recorder {
  static inline std::vector<std::size_t> sizes;
  static inline const KernelRow* answers = nullptr;
  static KernelRow row(const KernelRow& of) {
    KernelRow recording = of;
    answers = &of, sizes.clear();
    recording.timed = {
        [](const Accel& accel, const KernelRow&, RayBatch rays, std::span<Hit> hits, Counters*) {
          sizes.push_back(rays.size());
          answers->closest_hit(accel, rays, hits);
        },
        [](const Accel& accel, const KernelRow&, RayBatch rays, std::span<std::uint8_t> occluded, Counters*) {
          sizes.push_back(rays.size());
          answers->any_hit(accel, rays, occluded);
        }};
    return recording;
  }
};

}  // namespace

TEST_CASE("how many rays a call has follows the call and the width of the way of traversal") {
  for (const char* way : {"single", "packet8", "queued", "stream", "auto"})
    CHECK(rays_a_call(cell_of_call(way, "batch")) == 0);
  for (const char* way : {"single", "packet8", "hybrid4", "auto"}) {
    CHECK(rays_a_call(cell_of_call(way, "ray")) == 1);
    CHECK(why_no_call(cell_of_call(way, "ray")).empty());
  }
  for (const auto& [way, rays] : std::map<std::string, std::size_t>{
           {"packet4", 4}, {"packet64", 64}, {"hybrid16", 16}, {"packet8_coherent", 8}}) {
    CHECK(rays_a_call(cell_of_call(way, "packet")) == rays);
    CHECK(why_no_call(cell_of_call(way, "packet")).empty());
  }
  for (const char* way : {"single", "queued", "stream", "auto"})
    CHECK_THAT(why_no_call(cell_of_call(way, "packet")), Catch::Contains("names no width"));
  for (const char* way : {"queued", "queued8", "stream", "stream_sorted"})
    CHECK_THAT(why_no_call(cell_of_call(way, "ray")), Catch::Contains("needs rays beside each other"));
  CHECK_THAT(why_no_call(cell_of_call("single", "ray", "path")), Catch::Contains("calls with batches alone"));
  CHECK(why_no_call(cell_of_call("single", "batch", "path")).empty());
}

TEST_CASE("a plan names a call where it is no batch, has one build for all, and says what cannot be called so") {
  const Folder folder;
  const Registry registry = paper_registry();
  const auto experiment = [&](const std::string& more) {
    return read_experiment(folder.write("calls.yaml", R"(
scenes: [{generate: sphere, triangles: 500}]
axes: {structure: [tree], isa: [sse], intersector: [moller_trumbore], traversal: [single, packet])" +
                                                          more),
                           registry);
  };
  const Plan plan = make_plan(experiment(", call: [batch, packet, ray]}\n"), registry);
  const std::string head = "trace/sphere-500/tree/binned_sah/triangle4/moller_trumbore/fast/",
                    tail = "/sse/primary/threads:1";
  CHECK(names(plan, Cell::Metric::trace) ==
        std::vector<std::string>{head + "single" + tail, head + "single:call=ray" + tail, head + "packet4" + tail,
                                 head + "packet4:call=packet" + tail, head + "packet4:call=ray" + tail});
  CHECK(names(plan, Cell::Metric::build).size() == 1);
  REQUIRE(plan.skipped.size() == 1);
  CHECK(plan.skipped[0].name == head + "single:call=packet" + tail);
  CHECK_THAT(plan.skipped[0].reason, Catch::Contains("single names no width"));

  // Not asked for, it is a batch, and no name tells.
  const Experiment plain = experiment("}\n");
  CHECK(names(make_plan(plain, registry), Cell::Metric::trace) ==
        std::vector<std::string>{head + "single" + tail, head + "packet4" + tail});
  CHECK_THAT(effective_yaml(plain), Catch::Contains("call: [batch]"));

  const Plan chosen = make_plan(experiment("}\ninclude: [{structure: tree, traversal: single, call: ray}]\n"
                                           "exclude: [{traversal: packet, call: batch}]\nmetrics: [trace]\n"),
                                registry);
  CHECK(names(chosen, Cell::Metric::trace) ==
        std::vector<std::string>{head + "single" + tail, head + "single:call=ray" + tail});
  CHECK_THAT(error_of([&] { (void)experiment(", call: [rey]}\n"); }), Catch::Contains("did you mean 'ray'"));
  VerifyCommand verify;
  verify.axes = {"call=ray"};
  CHECK_THAT(error_of([&] { (void)make_verify_plan(verify, {.spec = {}, .name = "sphere"}, false, registry); }),
             Catch::Contains("verify calls with batches alone"));

  // From a result back to the cell.
  for (const Cell& cell : plan.cells) {
    Json entry;
    add_axes(entry, cell);
    CHECK(entry["call"] == (cell.metric == Cell::Metric::build ? "-" : cell.call));
    CHECK(cell_of(entry).name() == cell.name());
    CHECK(cell_of(entry).call == cell.call);
    entry.erase("call");  // a folder of an earlier version
    CHECK(cell_of(entry).name() == cell.name());
  }
}

TEST_CASE("every call answers the same, with as many rays as it says") {
  const MeasureSettings small{.repetitions = 1, .warmup = 0, .min_time = 0.0, .width = 50, .height = 41};
  const SceneSpec spec = parse_scene_word("sphere:500");
  SceneData data({.spec = spec, .name = "sphere"}, small, [](const std::string&) {});
  Structures structures(data.mesh());
  std::size_t compared = 0;
  for (const char* structure : {"bvh8", "kdtree", "embree"}) {
    for (const char* traversal : {"single", "packet4", "hybrid4", "auto"}) {
      const bool embree = structure == std::string_view("embree");
      const KernelRow* row =
          find_kernel(structure, "triangle4v", embree ? "pluecker" : "watertight", "padded", traversal, Isa::sse);
      if (!row || !is_available(Isa::sse)) continue;
      const Accel& accel = structures.get(*row);
      for (const char* name : {"primary", "shadow"}) {
        for (const SelfIntersection start : {SelfIntersection::error_bound, SelfIntersection::exclusion}) {
          const Workload& workload = data.workload(name, {start, 0.0});
          std::vector<Hit> hits;
          std::vector<std::uint8_t> occluded;
          for (const std::string_view call : kCalls) {
            Cell cell = cell_of_call(traversal, std::string(call), name);
            if (!why_no_call(cell).empty()) continue;
            INFO(structure << ' ' << traversal << ' ' << call << ' ' << name);
            const KernelRow recording = Recorder::row(*row);
            cell.kernel = &recording, cell.start = {start, 0.0};
            AnswerBuffers buffers;
            Json facts;
            TraceJob job(cell, accel, workload, buffers);
            job.prepare(facts, data, small);
            CHECK(facts["wrong_answers"] == 0);
            const std::size_t rays = workload.rays.size(), each = rays_a_call(cell);
            REQUIRE(rays > 300);
            REQUIRE(!Recorder::sizes.empty());
            if (!workload.excludes_sources) {
              CHECK(*std::ranges::max_element(Recorder::sizes) == (each == 0 ? rays : each));
              // The pass whose answers are checked, and the one that is timed.
              CHECK(Recorder::sizes.size() == 2 * (each == 0 ? 1 : (rays + each - 1) / each));
            }
            if (hits.empty() && occluded.empty()) {
              hits = buffers.hits, occluded = buffers.occluded;
            } else if (!embree) {  // whose packets promise no bits
              CHECK(same_bits(hits, buffers.hits));
              CHECK(occluded == buffers.occluded);
            }
            ++compared;
          }
        }
      }
    }
  }
  CHECK((compared >= 60 || !is_available(Isa::sse)));
}
