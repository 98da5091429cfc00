// Secondary rays start on surfaces, where the error of t decides whether a ray meets its own surface again: every
// workload over generated scenes with large and small triangles side by side, against the oracle, ray by ray.
#include <algorithm>
#include <string>
#include <utility>
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
  for (const char* word : {"city:3000", "cornell_box:2000", "fractal_terrain:5000", "teapot_in_stadium:4000", "needles:2000"}) {
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
      // What is judged once need not be again: most rows give the same bits.
      std::vector<std::vector<Hit>> judged;
      std::vector<std::vector<std::uint8_t>> judged_any;
      for (const KernelRow& row : runnable_rows()) {
        if (row.intersector != "watertight" || row.box != "padded") continue;
        const Accel& accel = structures.get(row);
        AnswerCheck check;
        if (any) {
          std::vector<std::uint8_t> answers = any_hit(row, accel, workload.rays);
          if (std::ranges::find(judged_any, answers) != judged_any.end()) continue;
          check = oracle.check_any_hit(workload.rays, any_truth, answers);
          judged_any.push_back(std::move(answers));
        } else {
          std::vector<Hit> answers = closest_hit(row, accel, workload.rays);
          if (std::ranges::any_of(judged, [&](const std::vector<Hit>& other) { return same_bits(answers, other); })) continue;
          check = oracle.check_closest_hit(workload.rays, truth, answers);
          judged.push_back(std::move(answers));
        }
        INFO(word << " " << name << ": " << name_of(row));
        CAPTURE(check.missed_hits, check.false_hits, check.wrong_surface);
        CHECK(check.wrong_answers() == 0);
      }
    }
  }
  CHECK(rays_checked > 50000);
}
