// Secondary rays start on surfaces, where the error of t decides whether a ray meets its own surface again: every
// workload over generated scenes with large and small triangles side by side, against the oracle, ray by ray.
#include <string>
#include <vector>

#include "oracle/oracle.h"
#include "rendering/workload.h"
#include "scenes/scene.h"
#include "tests/catch.h"
#include "tests/kernel_runner.h"

using namespace arboretum;
using namespace arboretum::test;

TEST_CASE("watertight with padded boxes has no wrong answer in any workload") {
  std::size_t rays_checked = 0;
  for (const char* word :
       {"city:3000", "cornell_box:2000", "fractal_terrain:5000", "teapot_in_stadium:4000", "needles:2000"}) {
    const Scene scene = load_scene(parse_scene_word(word));
    const Oracle oracle(scene.mesh);
    const View view{64, 64, 1};
    const Workload primary = make_primary(scene, view);
    std::vector<Hit> primary_hits;
    for (const ExactHit& h : oracle.closest_hit(primary.rays)) primary_hits.push_back(h.hit);
    Structures structures(scene.mesh);
    for (std::string_view name : workload_names()) {
      const Workload workload = make_workload(name, scene, view, primary.rays, primary_hits);
      rays_checked += workload.rays.size();
      const bool any = workload.query == Query::any_hit;
      const auto any_truth = any ? oracle.any_hit(workload.rays) : std::vector<std::uint8_t>{};
      const auto truth = any ? std::vector<ExactHit>{} : oracle.closest_hit(workload.rays);
      for (const KernelRow& row : runnable_rows()) {
        if (row.intersector != "watertight" || row.box != "padded") continue;
        const Accel& accel = structures.get(row);
        const AnswerCheck check =
            any ? oracle.check_any_hit(workload.rays, any_truth, any_hit(row, accel, workload.rays))
                : oracle.check_closest_hit(workload.rays, truth, closest_hit(row, accel, workload.rays));
        INFO(word << " " << name << ": " << name_of(row));
        CAPTURE(check.missed_hits, check.false_hits, check.wrong_surface);
        CHECK(check.wrong_answers() == 0);
      }
    }
  }
  CHECK(rays_checked > 50000);
}
