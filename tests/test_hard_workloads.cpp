// Hard rays as workloads, placed scenes, and where leaks are: what is made, what a run counts of it.
#include <cmath>
#include <fstream>
#include <sstream>

#include "experiments/config.h"
#include "experiments/journal.h"
#include "experiments/plan.h"
#include "experiments/runner.h"
#include "experiments/scene_data.h"
#include "oracle/random_cases.h"
#include "rendering/hard_workload.h"
#include "scenes/camera.h"
#include "tests/catch.h"
#include "tests/golden_hash.h"
#include "tests/scene_files.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

Scene scene_of(const char* word) { return load_scene(parse_scene_word(word)); }

SceneData data_of(const char* word, const Placing& placing = {}) {
  static const MeasureSettings kSmall{.width = 64, .height = 48};
  return {{.spec = parse_scene_word(word), .name = "scene", .placing = placing}, kSmall, [](const std::string&) {}};
}

}  // namespace

TEST_CASE("a picture position and its ray belong to each other; behind the camera there is none") {
  const Scene scene = scene_of("cornell_box:200");
  const RayGenerator camera(view_of(scene), 320, 200);
  for (const auto& [x, y] : {std::pair{0.5, 0.5}, {160.0, 100.0}, {319.0, 3.25}, {-20.0, 250.0}}) {
    const Ray ray = camera.ray(x, y);
    for (double t : {0.5, 100.0}) {
      const auto pixel = camera.pixel(Vec3d(ray.origin) + Vec3d(ray.direction) * t);
      CHECK(pixel[0] == Approx(x).margin(1e-3));
      CHECK(pixel[1] == Approx(y).margin(1e-3));
    }
    CHECK(std::isnan(camera.pixel(Vec3d(ray.origin) - Vec3d(ray.direction))[0]));
  }
}

TEST_CASE(
    "hard workloads: as many rays as pixels, of their kind, the same for the same seed; none where there is nothing to "
    "aim at") {
  const Scene closed = scene_of("sphere:200"), open = scene_of("fractal_terrain:300");
  const View view{.width = 20, .height = 10, .seed = 3};
  for (std::string_view name : hard_workload_names()) {
    INFO(name);
    CHECK(is_hard(name));
    const Workload made = make_hard_workload(name, open, view);
    CHECK(made.name == name);
    CHECK(made.query == Query::closest_hit);
    REQUIRE(made.rays.size() == 200);
    CHECK(made.pixels.size() == (name == "camera_edges" ? 200u : 0u));
    for (const Ray& ray : made.rays) CHECK(is_valid(ray));
    const auto same = [&](const Workload& other) {
      return std::ranges::equal(made.rays, other.rays, [](const Ray& a, const Ray& b) {
        return a.origin == b.origin && a.direction == b.direction;
      });
    };
    CHECK(same(make_hard_workload(name, open, view)));
    CHECK_FALSE(same(make_hard_workload(name, open, {.width = 20, .height = 10, .seed = 4})));
    CHECK(make_hard_workload(name, closed, view).rays.size() == (name == "hard_border" ? 0u : 200u));
  }
  CHECK_FALSE(is_hard("diffuse"));
  CHECK_THROWS_AS(make_hard_workload("diffuse", closed, view), std::invalid_argument);
  // Each kind of ray is what its name says: those in planes have a direction without that axis, those along axes have
  // one alone.
  for (const Ray& ray : make_hard_workload("hard_axis", closed, view).rays)
    CHECK((ray.direction.x != 0) + (ray.direction.y != 0) + (ray.direction.z != 0) == 1);
}

// Golden hashes: seeds that were written down, in cases files and reports, would stand for other rays.
TEST_CASE("hard rays and random subjects have the same bits with every compiler") {
  const TriangleMesh open = scene_of("fractal_terrain:300").mesh, moving = scene_of("waving_cloth:300").mesh;
  std::vector<HardKind> kinds;
  for (std::size_t k = 0; k < kMadeKinds; ++k) kinds.push_back(static_cast<HardKind>(k));
  const auto rays_of = [&](const TriangleMesh& mesh, std::span<const HardKind> of) {
    GoldenHash h;
    h.add(HardRayMaker(mesh).make(1, 0, 1000, of));
    return h.value;
  };
  CHECK(rays_of(open, kinds) == 0xc20b36437ff50fabu);
  CHECK(rays_of(moving, kinds) == 0x374dc468aaf0b4a3u);
  constexpr std::uint64_t kOfKind[kMadeKinds] = {0x6034869c766b2f88u, 0x247ead6b1d83d943u, 0x6a8de56408e84d9bu,
                                                 0x489e4477ff46beabu, 0xa30369c4e20fe1e3u, 0x3e20e415b0c8a967u,
                                                 0x4d79284765eeb69cu, 0x0f3acf435a53a319u, 0xbd98039b0fc2bc18u,
                                                 0x4fa8dc4c8b3ad396u, 0x19ae15fc872fbd72u};
  for (std::size_t k = 0; k < kMadeKinds; ++k) {
    INFO(to_string(kinds[k]));
    CHECK(rays_of(open, std::span(&kinds[k], 1)) == kOfKind[k]);
  }
  constexpr std::uint64_t kSubjects[10] = {
      0x438922ef93e63c52u, 0x4daa7fcf3a44164au, 0xb94c2436cd87c183u, 0xf3fc846ff57ca93bu, 0xa83533ec4c525abdu,
      0x716c51f8f172feedu, 0x20fc7e8a5d100033u, 0xd66970b157916f7eu, 0x92f30321738f1ce6u, 0xe41f846fd5069a0eu};
  for (std::uint64_t i = 0; i < std::size(kSubjects); ++i) {
    INFO(i);
    const RandomSubject subject = random_subject(1, i, 100);
    GoldenHash h;
    h.add(subject.mesh), h.add(subject.rays);
    CHECK(h.value == kSubjects[i]);
  }
  GoldenHash mutations;
  const RandomSubject given = random_subject(1, 0, 1);
  for (std::uint64_t i = 0; i < 100; ++i) {
    const RandomSubject subject = mutated_subject(given.mesh, given.rays.rays[0], 1, i, 10);
    mutations.add(subject.mesh), mutations.add(subject.rays);
  }
  CHECK(mutations.value == 0x5a0d981039365619u);
}

TEST_CASE(
    "rays at edges from the camera meet what they are aimed at, where it is seen; an answer that misses it is a leak "
    "there") {
  SceneData data = data_of("sphere:400");
  const Workload& edges = data.workload("camera_edges");
  const auto seen = data.seen_pixels(edges);
  // About half of a sphere.
  CHECK(seen.size() > edges.rays.size() / 4);
  CHECK(seen.size() < 3 * edges.rays.size() / 4);
  const Oracle oracle(data.mesh());
  std::vector<Hit> answers;
  for (const ExactHit& h : oracle.closest_hit(edges.batch())) answers.push_back(h.hit);
  CHECK(data.leak_pixels(edges, answers).empty());
  std::vector<std::array<float, 2>> missed;
  for (std::size_t i = 0; i < answers.size() && missed.size() < 5; ++i) {
    if (std::fabs(answers[i].t - 1.0f) > 1e-3f ||
        oracle.judge(edges.rays[i], 0.0f, oracle.closest_hit(std::span(&edges.rays[i], 1))[0], Hit{}).crack == false)
      continue;
    answers[i] = Hit{};
    missed.push_back(edges.pixels[i]);
  }
  REQUIRE(missed.size() == 5);
  CHECK(data.leak_pixels(edges, answers) == missed);
  const Json points = picture_points(missed, 3);
  CHECK(points.size() == 3);  // every second of five
  CHECK(points[0][0].get<double>() == Approx(missed[0][0]).margin(0.051));
}

TEST_CASE("placing stretches, then sizes, then moves, and says so") {
  SceneData plain = data_of("sphere:400"),
            placed = data_of("sphere:400", {.stretch = 10, .size = 4, .offset = 100, .label = ":x"});
  REQUIRE(placed.mesh().vertices.size() == plain.mesh().vertices.size());
  for (std::size_t i = 0; i < plain.mesh().vertices.size(); ++i) {
    const Vec3f from = plain.mesh().vertices[i], to = placed.mesh().vertices[i];
    CHECK(to.x == Approx(4.0 * from.x + 100.0).margin(1e-4));
    CHECK(to.y == Approx(40.0 * from.y - 75.0).margin(1e-4));
    CHECK(to.z == Approx(4.0 * from.z + 50.0).margin(1e-4));
  }
  CHECK(plain.facts().empty());
  CHECK(placed.facts()["offset"] == 100);
  CHECK(placed.facts()["radius"].get<double>() == Approx(std::sqrt(4.0 * 4 + 40 * 40 + 4 * 4)).epsilon(0.02));
  const double aspect = placed.facts()["triangle_aspect_median"].get<double>();
  CHECK(aspect > 5);
  CHECK(aspect < 60);
  // Framed whole: the primary rays meet it.
  const Workload& primary = placed.workload("primary");
  const Oracle oracle(placed.mesh());
  CHECK(std::ranges::count_if(oracle.closest_hit(primary.batch()), [](const ExactHit& h) { return h.hit.is_hit(); }) >
        50);
}

TEST_CASE("a run counts leaks by place and test, and keeps where they are, once a cell") {
  const Folder folder;
  const Registry registry = this_registry();
  const std::string isa(to_string(registry.isas.back()));
  const auto file = folder.write(
      "leaks.yaml", R"(
scenes: [{generate: sphere, triangles: 500}, {generate: sphere, triangles: 500, size: 100, offset: [0, 1e4]}]
axes: {structure: [bvh8], isa: [)" +
                        isa +
                        R"(], intersector: [moller_trumbore, watertight, exact], workload: [hard_vertex, camera_edges]}
exclude: [{scene: "sphere-500:size=100:offset=0", workload: camera_edges}, {scene: "sphere-500:size=100:offset=1e4", workload: camera_edges}]
measure: {repetitions: 2, warmup: 0, min_time: 0.001, resolution: [96, 96]}
metrics: [trace, accuracy]
)");
  const Experiment experiment = read_experiment(file, registry);
  CHECK(experiment.plots == std::vector<std::string>{"rays_per_second", "rays_by_builder", "bytes_per_triangle",
                                                     "memory_vs_time", "visits_per_ray", "accuracy_vs_time",
                                                     "leaks_vs_distance", "leaks_vs_aspect", "leak_picture"});
  const Plan plan = make_plan(experiment, registry);
  Journal journal(folder.path(), "hash", plan, false);
  const RunOutcome outcome = run_plan(experiment, plan, registry, journal, {});
  REQUIRE(outcome.results.size() == 3 * 3 + 3);
  for (const CellResult& result : outcome.results) {
    INFO(result.cell.name());
    CHECK(result.fact("rays") == 96 * 96);
    const bool picture = result.cell.workload == "camera_edges", placed = result.cell.scene_index > 0;
    CHECK(result.has_fact("leak_points") == picture);
    CHECK(result.has_fact("offset") == placed);
    if (result.cell.intersector == "moller_trumbore") {
      CHECK(result.fact("cracks") > 0);
    } else {
      CHECK(result.fact("cracks") == 0);
    }
    if (picture) {
      CHECK(result.facts["leak_points"].size() == result.fact("cracks"));
      REQUIRE(result.repetitions.size() == 2);
      CHECK(repetition_entry(result, result.repetitions[0]).contains("leak_points"));
      CHECK_FALSE(repetition_entry(result, result.repetitions[1]).contains("leak_points"));
      for (const Json& entry : aggregate_entries(result)) CHECK_FALSE(entry.contains("leak_points"));
    }
  }
  std::stringstream text;
  text << std::ifstream(folder.path() / "camera_edges-sphere-500.json").rdbuf();
  const Json seen = Json::parse(text.str());
  CHECK(seen["width"] == 96);
  CHECK(seen["points"].size() > 1000);
}
