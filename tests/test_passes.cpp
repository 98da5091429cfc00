// How many passes and builds a repetition has: one that was slow, once, does not make all repetitions short.
#include "experiments/passes.h"

#include <cmath>
#include <string>
#include <vector>

#include "core/timer.h"
#include "experiments/build_job.h"
#include "experiments/render_job.h"
#include "experiments/scene_data.h"
#include "experiments/structure_cache.h"
#include "experiments/trace_job.h"
#include "tests/catch.h"
#include "tests/kernel_runner.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

constexpr double kMinTime = 0.02, kPass = 0.0002;
const MeasureSettings kSmall{.repetitions = 1, .warmup = 0, .min_time = kMinTime, .width = 8, .height = 8};

void spin(double seconds) {
  for (const double end = thread_cpu_seconds() + seconds; thread_cpu_seconds() < end;) {
  }
}

/// A row that answers as another and takes longer: much longer in its second pass, which is the first that is timed.
struct SlowOnce {
  static inline const KernelRow* answers = nullptr;
  static inline int passes = 0;
  static KernelRow row(const KernelRow& of) {
    KernelRow slow = of;
    answers = &of, passes = 0;
    slow.timed = {[](const Accel& accel, const KernelRow&, RayBatch rays, std::span<Hit> hits, Counters*) {
                    spin(++passes == 2 ? 5 * kMinTime : kPass);
                    answers->closest_hit(accel, rays, hits);
                  },
                  [](const Accel& accel, const KernelRow&, RayBatch rays, std::span<std::uint8_t> occluded, Counters*) {
                    answers->any_hit(accel, rays, occluded);
                  }};
    return slow;
  }
};

const KernelRow& plain_row() {
  const KernelRow* row =
      find_kernel("bvh8", default_leaf("bvh8", "watertight", best_isa()), "watertight", "padded", "single", best_isa());
  REQUIRE(row);
  return *row;
}

}  // namespace

TEST_CASE("the passes of a repetition last min_time by the least of several, up to the most that may be") {
  struct Case {
    std::string name;
    double min_time;
    std::vector<double> seconds;  ///< of each pass; the last one's of all further ones
    std::uint64_t passes;
    std::size_t tried;
  };
  const Case cases[] = {{"steady", 1.0, {0.1}, 10, 5},
                        {"slow once", 1.0, {0.9, 0.1}, 10, 2},
                        {"slow twice, while they have not lasted half of min_time", 1.0, {0.2, 0.2, 0.05}, 20, 4},
                        {"longer than min_time", 1.0, {3.0}, 1, 2},
                        {"longer than min_time once", 1.0, {3.0, 0.3}, 4, 2},
                        {"quicker than the clock", 0.2, {0.0}, 1000, 1000},
                        {"min_time 0 takes one", 0.0, {0.1}, 1, 1}};
  for (const Case& c : cases) {
    INFO(c.name);
    std::size_t tried = 0;
    CHECK(passes_lasting(c.min_time, 1000, [&] { return c.seconds[std::min(tried++, c.seconds.size() - 1)]; }) ==
          c.passes);
    CHECK(tried == c.tried);
  }
}

TEST_CASE("a pass or picture that is slow once does not make repetitions shorter than min_time") {
  SceneData data({.spec = parse_scene_word("sphere:100"), .name = "sphere"}, kSmall, [](const std::string&) {});
  Structures structures(data.mesh());
  const KernelRow row = SlowOnce::row(plain_row());
  const Accel& accel = structures.get(row);
  AnswerBuffers buffers;
  Json facts;
  Cell cell;
  cell.kernel = &row;
  for (const char* name : {"primary", "path"}) {
    INFO(name);
    cell.workload = name;
    SlowOnce::passes = 0;
    std::uint64_t passes = 0;
    if (name == std::string("path")) {
      RenderJob job(cell, accel, data.rendered(name), buffers);
      job.prepare(facts, data, kSmall);
      passes = job.passes();
    } else {
      TraceJob job(cell, accel, data.workload(name, {}), buffers);
      job.prepare(facts, data, kSmall);
      passes = job.passes();
    }
    CHECK(passes > 1);
    CHECK(double(passes) <= std::ceil(kMinTime / kPass));
  }
}

TEST_CASE("builds of a repetition last min_time or 20 ms, however slow the first was") {
  SceneData data({.spec = parse_scene_word("sphere:100"), .name = "sphere"}, kSmall, [](const std::string&) {});
  Registry registry = this_registry();
  StructureCache cache({}, [](const std::string&) {});
  StructurePool pool(data.mesh(), registry, false, cache);
  Cell cell;
  cell.metric = Cell::Metric::build;
  cell.structure = "bvh8", cell.builder = "binned_sah", cell.leaf = "triangle4";
  struct Case {
    double min_time, first, further;
    std::uint64_t builds;
    int tried;
  };
  // A build that is long is not tried again; whatever min_time is, 20 ms are enough.
  for (const Case& c : {Case{0.01, 0.03, 0.002, 5, 4}, {0.01, 0.05, 0.002, 1, 1}, {1.0, 0.07, 0.002, 10, 6}}) {
    INFO(c.min_time << ' ' << c.first);
    int tried = 0;
    registry.build = [&](std::string_view structure, const TriangleMesh& mesh, const BuildSettings& settings,
                         BuildReport& report) {
      auto accel = build_structure(structure, mesh, settings, report);
      report.seconds = tried++ == 0 ? c.first : c.further;
      return accel;
    };
    MeasureSettings measure = kSmall;
    measure.min_time = c.min_time;
    BuildJob job(cell, data.mesh(), registry);
    Json facts = Json::object();
    job.prepare(facts, pool, measure);
    CHECK(job.builds() == c.builds);
    CHECK(tried == c.tried);
  }
}
