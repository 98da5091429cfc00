// The workloads `whitted` and `path`: what is recorded of a renderer, that cells answer it rightly, and that wrong
// answers are seen.
#include "experiments/render_job.h"
#include "experiments/scene_data.h"
#include "scenes/generators/generators.h"
#include "tests/catch.h"
#include "tests/kernel_runner.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

const MeasureSettings kSmall{.repetitions = 1, .warmup = 0, .min_time = 0, .width = 40, .height = 30};

SceneData data_of(const std::string& word) {
  return {{.spec = parse_scene_word(word), .name = word}, kSmall, [](const std::string&) {}};
}

/// The row of single rays, by the best instruction set.
const KernelRow& row_of(std::string_view structure, std::string_view intersector) {
  const KernelRow* row = find_kernel(structure, default_leaf(structure, intersector, best_isa()), intersector, "padded",
                                     "single", best_isa());
  REQUIRE(row);
  return *row;
}

/// How far two pictures are apart, as a share of the first one's light.
double difference(const Picture& a, const Picture& b) {
  double apart = 0.0, light = 0.0;
  for (std::size_t i = 0; i < a.pixels.size(); ++i) {
    apart += std::abs(double(a.pixels[i].y) - double(b.pixels[i].y));
    light += double(a.pixels[i].y);
  }
  REQUIRE(light > 0.0);
  return apart / light;
}

}  // namespace

TEST_CASE(
    "recorded rays: those of the exact picture, answered exactly by `exact`, and the same picture by all structures") {
  for (const std::string word : {"cornell_box:2000", "sphere_flake:2000", "sphere:500"}) {
    SceneData data = data_of(word);
    Structures structures(data.mesh());
    for (const std::string name : {"whitted", "path"}) {
      const RenderedRays& rays = data.rendered(name);
      INFO(word << " " << name);
      CHECK(&rays == &data.rendered(name));
      REQUIRE(rays.closest().rays.size() >= 40 * 30);
      REQUIRE(rays.closest_truth().size() == rays.closest().rays.size());
      REQUIRE(rays.any().rays.size() > 100);
      REQUIRE(rays.any_truth().size() == rays.any().rays.size());
      CHECK(rays.closest().name == name);
      CHECK(rays.any().query == Query::any_hit);
      for (const std::string_view structure : {"brute_force", "bvh8", "kdtree"}) {
        const KernelRow& row = row_of(structure, "exact");
        const Accel& accel = structures.get(row);
        const std::vector<Hit> hits = closest_hit(row, accel, rays.closest().rays);
        const AnswerCheck check = data.check(rays, hits);
        CHECK(check.rays == rays.closest().rays.size());
        CHECK(check.wrong_answers() + check.wrong_primitive == 0);
        CHECK(check.t_error_ulp_max <= 0.5);  // t is the exact one, rounded
        CHECK(data.check(rays, any_hit(row, accel, rays.any().rays)).wrong_answers() == 0);
        // The kernel leads the renderer the same way; u and v may differ in the last bits, which mirrors and glass
        // magnify.
        RenderStatistics statistics;
        const Picture picture = rays.render(accel, row, {}, 2, statistics);
        CHECK(difference(rays.picture(), picture) < 0.01);
        CHECK(double(statistics.total().rays) ==
              Approx(double(rays.closest().rays.size() + rays.any().rays.size())).epsilon(0.01));
        // What is wrong is seen.
        std::vector<Hit> wrong = hits;
        wrong[0] = hits[0].is_hit() ? Hit{} : Hit{.t = 1, .u = 0, .v = 0, .primitive = 0};
        CHECK(data.check(rays, wrong).wrong_answers() == 1);
      }
    }
  }
}

TEST_CASE("cells of a renderer's workload: facts, and as many rays for all that answer alike") {
  SceneData data = data_of("cornell_box:2000");
  Structures structures(data.mesh());
  for (const std::string name : {"whitted", "path"}) {
    std::set<std::uint64_t> rays;
    for (const std::string_view structure : {"bvh8", "bvh4", "kdtree"}) {
      const KernelRow& row = row_of(structure, "watertight");
      Cell cell;
      cell.structure = structure, cell.workload = name, cell.kernel = &row;
      AnswerBuffers buffers;
      RenderJob job(cell, structures.get(row), data.rendered(name), buffers);
      Json facts = Json::object();
      job.prepare(facts, data, kSmall);
      CHECK(facts["wrong_answers"] == 0);
      CHECK(facts["hits"].get<std::size_t>() > 100);
      CHECK(facts["checked_rays"] == data.rendered(name).closest().rays.size() + data.rendered(name).any().rays.size());
      CHECK(facts["nodes_per_ray"].get<double>() > 1.0);
      CHECK(facts["shading_share"].get<double>() > 0.0);
      CHECK(facts["shading_share"].get<double>() < 1.0);
      CHECK(job.passes() == 1);
      rays.insert(facts["rays"].get<std::uint64_t>());
      struct Twice : TimedLoop {
        int left = 2;
        bool next() override { return left-- > 0; }
      } loop;
      const Repetition repetition = job.measure(loop);
      CHECK(repetition.cpu_seconds > 0.0);
      CHECK(repetition.wall_seconds > 0.0);
    }
    CHECK(rays.size() == 1);
  }
}

TEST_CASE("what moves, and what cannot be seen, is traced in the structure of the whole mesh") {
  SceneData moving = data_of("waving_cloth:500");
  REQUIRE(moving.mesh().moves());
  const RenderedRays& rays = moving.rendered("path");
  CHECK(rays.closest().times.size() == rays.closest().rays.size());
  CHECK(rays.any().times.size() == rays.any().rays.size());

  Scene scene = generate_scene("cornell_box", 600, 1);
  for (Material& m : scene.materials)
    if (m.name == "glass") m.ior = 1.0f;
  const Oracle oracle(scene.mesh);
  const View view{.width = 24, .height = 24};
  const RenderedRays through("path", scene, view, {0, 1, 2}, oracle);
  const KernelRow& row = row_of("bvh8", "exact");
  Structures structures(scene.mesh);
  RenderStatistics statistics;
  CHECK(difference(through.picture(), through.render(structures.get(row), row, {}, 1, statistics)) < 0.01);
  CHECK(statistics[RayKind::alpha_cutout].rays > 0);
  CHECK(statistics[RayKind::dielectric].rays == 0);
}
