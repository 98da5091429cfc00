// Motion: boxes that hold their triangles at every time; bvh4_motion against brute force over the mesh as it stands at
// the ray's time, bit for bit; the oracle at every time; no crack in a closed mesh that moves; workloads' times.
#include <map>

#include "oracle/oracle.h"
#include "rendering/workload.h"
#include "structures/bvh4_motion/bvh4_motion.h"
#include "tests/catch.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"
#include "tests/scene_files.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

/// The mesh with `frames` key frames: every vertex wanders by up to `reach` from one to the next, shared ones together.
TriangleMesh wandering(TriangleMesh mesh, std::size_t frames, float reach, std::uint64_t seed) {
  const Bounds3f cube{{-reach, -reach, -reach}, {reach, reach, reach}};
  for (std::size_t k = 1; k < frames; ++k) {
    std::vector<Vec3f> next = mesh.frame(k - 1);
    for (std::size_t i = 0; i < next.size(); ++i) next[i] = next[i] + uniform_point(seed, i, 3 * k, cube);
    mesh.later_frames.push_back(std::move(next));
  }
  return mesh;
}

/// A sphere that is turned, moved and stretched from frame to frame.
TriangleMesh flying_sphere(std::uint32_t rings, std::size_t frames, Vec3f offset) {
  TriangleMesh mesh = moved(sphere(rings), 1.0f, offset);
  const std::vector<Vec3f> start = sphere(rings).vertices;
  for (std::size_t k = 1; k < frames; ++k) {
    const double a = 0.35 * double(k);
    std::vector<Vec3f>& frame = mesh.later_frames.emplace_back();
    for (const Vec3f& v : start) {
      const Vec3f turned{float(v.x * std::cos(a) - v.y * std::sin(a)), float(v.x * std::sin(a) + v.y * std::cos(a)),
                         v.z * (1.0f + 0.1f * float(k))};
      frame.push_back(turned + offset + Vec3f{0.15f * float(k), -0.1f * float(k), 0.05f * float(k)});
    }
  }
  return mesh;
}

/// Times at and between key frames, a few for each mesh, so that it is posed a few times only.
const std::vector<float> kTimes{0.0f, 0x1p-30f, 0.1f, 1.0f / 3.0f, 0.5f, 0.72f, 0.99999994f, 1.0f};

std::vector<KernelRow> motion_rows() {
  std::vector<KernelRow> rows;
  for (const KernelRow& row : runnable_rows())
    if (row.structure == "bvh4_motion") rows.push_back(row);
  return rows;
}

std::vector<Hit> closest_at(const KernelRow& row, const Accel& accel, const std::vector<Ray>& rays,
                            const std::vector<float>& times) {
  std::vector<Hit> hits(rays.size());
  row.closest_hit(accel, {rays, times}, hits, nullptr);
  return hits;
}

}  // namespace

TEST_CASE("interpolation gives both ends exactly, and frames are equally spaced") {
  CHECK(frame_at(0.0f, 3).frame == 0);
  CHECK(frame_at(0.5f, 3).frame == 1);
  CHECK(frame_at(0.5f, 3).weight == 0.0f);
  CHECK(frame_at(1.0f, 3).frame == 1);
  CHECK(frame_at(1.0f, 3).weight == 1.0f);
  CHECK(frame_at(7.0f, 3).weight == 1.0f);
  CHECK(frame_at(-1.0f, 3).weight == 0.0f);
  CHECK(frame_at(std::numeric_limits<float>::quiet_NaN(), 3).frame == 0);
  CHECK(interpolate(0.1f, 0.7f, 0.0f) == 0.1f);
  CHECK(interpolate(0.1f, 0.7f, 1.0f) == 0.7f);
}

TEST_CASE("linear boxes hold their triangles at every time") {
  for (std::size_t frames : {1u, 2u, 3u, 4u, 7u, 33u}) {
    for (float scale : {1.0f, 0x1p-30f, 0x1p30f}) {
      const TriangleMesh mesh = moved(random_triangles(40, 0.3f, frames), scale, {100 * scale, 0, 0});
      const TriangleMesh moving = wandering(mesh, frames, 0.3f * scale, 7);
      for (std::uint32_t i = 0; i < moving.size(); ++i) {
        const bvh4_motion::LinearBounds box = bvh4_motion::linear_bounds(moving, i);
        for (std::uint64_t k = 0; k < 60; ++k) {
          const float time = k < kTimes.size() ? kTimes[k] : random_float(3, i, k);
          for (const Vec3f& p : moving.corners(i, frame_at(time, frames))) {
            for (std::size_t axis = 0; axis < 3; ++axis) {
              const double t = time;
              REQUIRE(box.at0.lower[axis] * (1 - t) + box.at1.lower[axis] * t <= p[axis]);
              REQUIRE(box.at0.upper[axis] * (1 - t) + box.at1.upper[axis] * t >= p[axis]);
            }
          }
        }
      }
    }
  }
}

TEST_CASE("bvh4_motion gives the answers of brute force over the mesh at the ray's time, bit for bit") {
  for (std::size_t frames : {2u, 3u, 6u}) {
    for (const KernelScene& scene :
         {KernelScene{"soup", random_triangles(600, 0.2f, 2)}, KernelScene{"sphere", sphere(10)},
          KernelScene{"flat", flat_grid(12)}, KernelScene{"one", random_triangles(1, 0.7f, 3)},
          KernelScene{"large", moved(random_triangles(100, 0.3f, 5), 0x1p30f)}}) {
      const float size = scene.mesh.bounds().extent().x;
      const TriangleMesh mesh = wandering(scene.mesh, frames, 0.05f * size, frames);
      BuildSettings settings;
      settings.leaf = "triangle4i", settings.isa = best_isa();
      BuildReport report;
      const auto accel = build_structure("bvh4_motion", mesh, settings, report);
      for (float time : kTimes) {
        const TriangleMesh posed = pose(mesh, time);
        const auto still = build_structure("brute_force", posed,
                                           {.builder = "in_order", .leaf = "triangle4i", .parameters = {}}, report);
        std::vector<Ray> rays = generic_rays(posed, 80, 21);
        const std::vector<Ray> aimed = aimed_rays(posed, posed.bounds().center(), 60, 22);
        rays.insert(rays.end(), aimed.begin(), aimed.end());
        for (const Ray& ray : invalid_rays()) rays.push_back(ray);
        const std::vector<float> times(rays.size(), time);
        for (const KernelRow& row : motion_rows()) {
          if (row.box != "padded") continue;
          const KernelRow* reference =
              find_kernel("brute_force", "triangle4i", row.intersector, "padded", "single", row.isa);
          if (!reference)
            reference = find_kernel("brute_force", "triangle4v", row.intersector, "padded", "single", row.isa);
          REQUIRE(reference);
          if (reference->leaf != row.leaf) continue;
          INFO(scene.name << ", " << frames << " frames, time " << time << ": " << name_of(row));
          const std::vector<Hit> got = closest_at(row, *accel, rays, times),
                                 want = closest_hit(*reference, *still, rays);
          for (std::size_t i = 0; i < rays.size(); ++i) {
            INFO("ray " << i << ": t " << got[i].t << ", primitive " << got[i].primitive << "; brute force: t "
                        << want[i].t << ", primitive " << want[i].primitive);
            REQUIRE(same_bits({&got[i], 1}, {&want[i], 1}));
          }
          std::vector<std::uint8_t> occluded(rays.size(), 0xee);
          row.any_hit(*accel, {rays, times}, occluded, nullptr);
          for (std::size_t i = 0; i < rays.size(); ++i) REQUIRE(occluded[i] == std::uint8_t(got[i].is_hit()));
        }
      }
    }
  }
}

TEST_CASE("rays of many times in one batch get the bits that each gets alone, whatever the way of traversal") {
  const TriangleMesh mesh = wandering(random_triangles(800, 0.15f, 12), 4, 0.1f, 6);
  BuildSettings settings;
  settings.leaf = "triangle4i", settings.isa = best_isa();
  BuildReport report;
  const auto accel = build_structure("bvh4_motion", mesh, settings, report);
  // Some as they come, some beside each other towards one place, so that packets hold together; invalid ones between.
  std::vector<Ray> rays = generic_rays(mesh, 300, 41);
  for (std::uint64_t i = 0; i < 400; ++i) {
    const Vec3f from{3.0f, 2.0f + 0.01f * random_float(9, i, 0), 0.01f * random_float(9, i, 1)};
    const Vec3f to{0.5f * random_float(9, i, 2), 0.5f * random_float(9, i, 3), 0.5f};
    rays.push_back({from, 0.0f, to - from, kInfinity});
  }
  for (const Ray& ray : invalid_rays()) rays.insert(rays.begin() + 350, ray);
  std::vector<float> times;
  for (std::uint64_t i = 0; i < rays.size(); ++i) times.push_back(random_float(8, i, 0));
  times[3] = std::numeric_limits<float>::quiet_NaN(), times[4] = -2.0f, times[5] = 3.0f, times[400] = 7.0f;
  std::size_t hits = 0, rows = 0;
  for (const KernelRow& row : motion_rows()) {
    if (row.box != "padded" || row.traversal == "single") continue;
    const KernelRow* single = find_kernel(row.structure, row.leaf, row.intersector, row.box, "single", row.isa);
    REQUIRE(single);
    INFO(name_of(row));
    const std::vector<Hit> got = closest_at(row, *accel, rays, times), want = closest_at(*single, *accel, rays, times);
    REQUIRE(same_bits(got, want));
    std::vector<std::uint8_t> occluded(rays.size(), 0xee);
    row.any_hit(*accel, {rays, times}, occluded, nullptr);
    for (std::size_t i = 0; i < rays.size(); ++i) REQUIRE(occluded[i] == std::uint8_t(want[i].is_hit()));
    Counters counters;
    std::vector<Hit> counted(rays.size());
    row.closest_hit(*accel, {rays, times}, counted, &counters);
    CHECK(same_bits(counted, want));
    CHECK(counters.rays == rays.size());
    hits += std::size_t(std::ranges::count_if(want, &Hit::is_hit)), ++rows;
  }
  CHECK(rows >= 14);
  CHECK(hits > rows * 100);
}

TEST_CASE("the oracle answers a ray of any time as for the mesh that stands so") {
  const TriangleMesh mesh = wandering(random_triangles(300, 0.3f, 4), 4, 0.2f, 8);
  const Oracle oracle(mesh);
  std::vector<Ray> all;
  std::vector<float> times;
  std::vector<ExactHit> want;
  for (float time : kTimes) {
    const TriangleMesh posed = pose(mesh, time);
    std::vector<Ray> rays = generic_rays(posed, 200, 31);
    const std::vector<Ray> aimed = aimed_rays(posed, {0.1f, 0.2f, 0.3f}, 200, 32);
    rays.insert(rays.end(), aimed.begin(), aimed.end());
    const std::vector<ExactHit> truth = Oracle(posed).closest_hit(rays);
    all.insert(all.end(), rays.begin(), rays.end()), want.insert(want.end(), truth.begin(), truth.end());
    times.resize(all.size(), time);
  }
  const std::vector<ExactHit> got = oracle.closest_hit({all, times});
  const std::vector<std::uint8_t> any = oracle.any_hit({all, times});
  std::vector<Hit> hits;
  for (std::size_t i = 0; i < all.size(); ++i) {
    INFO("ray " << i << " at " << times[i]);
    REQUIRE(same_bits({&got[i].hit, 1}, {&want[i].hit, 1}));
    REQUIRE(any[i] == std::uint8_t(want[i].hit.is_hit()));
    hits.push_back(want[i].hit);
  }
  CHECK(oracle.check_closest_hit({all, times}, got, hits).wrong_primitive == 0);
  // A hole in the answers is seen as a crack at the time of the ray.
  const TriangleMesh ball = flying_sphere(12, 3, {0, 0, 0});
  const Ray ray{{0.1f, 0.1f, 0.1f}, 0, {0.3f, 0.5f, 0.6f}, kInfinity};
  const std::vector<float> half{0.5f};
  const RayBatch one{std::span(&ray, 1), half};
  const Oracle exact(ball);
  const Hit miss;
  CHECK(exact.check_closest_hit(one, exact.closest_hit(one), {&miss, 1}).cracks == 1);
}

TEST_CASE("watertight with padded boxes has no crack in a closed mesh that moves") {
  for (std::size_t frames : {2u, 5u}) {
    for (float offset : {0.0f, 1000.0f}) {
      const TriangleMesh mesh = flying_sphere(16, frames, {offset, -offset, offset});
      BuildSettings settings;
      settings.leaf = "triangle4i", settings.isa = best_isa();
      BuildReport report;
      const auto accel = build_structure("bvh4_motion", mesh, settings, report);
      std::vector<Ray> rays;
      std::vector<float> times;
      for (std::uint64_t i = 0; i < 3000; ++i) {
        const float time = random_float(5, i, 0);
        const auto c = mesh.corners(random_bits(5, i, 1) % mesh.size(), frame_at(time, frames));
        const std::size_t k = random_bits(5, i, 2) % 3;
        const Vec3f at = i % 2 ? c[k] : interpolate(c[k], c[(k + 1) % 3], random_float(5, i, 3));
        const Vec3f inside = Vec3f{offset, -offset, offset} + Vec3f{0.2f, -0.15f, 0.1f};
        rays.push_back({inside, 0.0f, at - inside, kInfinity}), times.push_back(time);
      }
      for (const KernelRow& row : motion_rows()) {
        if (row.intersector != "watertight" || row.box != "padded") continue;
        INFO(frames << " frames at " << offset << ": " << name_of(row));
        std::size_t cracks = 0;
        for (const Hit& hit : closest_at(row, *accel, rays, times)) cracks += !hit.is_hit();
        CHECK(cracks == 0);
      }
    }
  }
}

TEST_CASE("the waving cloth: no wrong answer in any workload; times lie in the shutter and go with their rays") {
  Scene scene = load_scene(parse_scene_word("waving_cloth:4000"));
  CHECK(scene.mesh.frames() == 5);
  scene.shutter = {0.25f, 0.75f};
  const Oracle oracle(scene.mesh);
  const View view{64, 48, 1};
  const Workload primary = make_primary(scene, view);
  REQUIRE(primary.times.size() == primary.rays.size());
  CHECK(primary.times == make_primary(scene, view).times);
  for (float time : primary.times) REQUIRE((time >= 0.25f && time <= 0.75f));
  CHECK(*std::ranges::max_element(primary.times) - *std::ranges::min_element(primary.times) > 0.45f);
  std::vector<Hit> primary_hits;
  std::vector<float> times_of_hits;
  for (const ExactHit& h : oracle.closest_hit(primary.batch())) {
    if (h.hit.is_hit()) times_of_hits.push_back(primary.times[primary_hits.size()]);
    primary_hits.push_back(h.hit);
  }
  BuildSettings settings;
  settings.leaf = "triangle4i", settings.isa = best_isa();
  BuildReport report;
  const auto accel = build_structure("bvh4_motion", scene.mesh, settings, report);
  for (std::string_view name : workload_names()) {
    const Workload workload = make_workload(name, scene, view, primary.batch(), primary_hits);
    if (is_secondary(name)) CHECK(workload.times == times_of_hits);
    const bool any = workload.query == Query::any_hit;
    const auto any_truth = any ? oracle.any_hit(workload.batch()) : std::vector<std::uint8_t>{};
    const auto truth = any ? std::vector<ExactHit>{} : oracle.closest_hit(workload.batch());
    for (const KernelRow& row : motion_rows()) {
      if (row.intersector != "watertight" || row.box != "padded") continue;
      INFO(name << ": " << name_of(row));
      std::vector<std::uint8_t> occluded(workload.rays.size());
      if (any) row.any_hit(*accel, workload.batch(), occluded, nullptr);
      const AnswerCheck check = any ? oracle.check_any_hit(workload.batch(), any_truth, occluded)
                                    : oracle.check_closest_hit(workload.batch(), truth,
                                                               closest_at(row, *accel, workload.rays, workload.times));
      CAPTURE(check.missed_hits, check.false_hits, check.wrong_surface, check.rays);
      CHECK(check.wrong_answers() == 0);
    }
  }
}

TEST_CASE("key frames through the scene file: spacing, shutter, instances") {
  const Folder folder;
  const auto obj = [](float x) { return "v " + std::to_string(x) + " 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"; };
  folder.write("a.obj", obj(0)), folder.write("b.obj", obj(0.25f)), folder.write("c.obj", obj(0.75f)),
      folder.write("still.obj", obj(0.5f));
  const Scene scene =
      load_file(folder.write("s.yaml",
                             "meshes: [{keyframes: [a.obj, b.obj, c.obj], name: m}, {keyframes: [a.obj, c.obj], name: "
                             "n}, still.obj]\nshutter: [0, 1]\n"
                             "instances: [{mesh: m, transforms: [{translate: [10, 0, 0]}, {scale: 2}]}]\n"));
  REQUIRE(scene.mesh.frames() == 3);
  CHECK_FALSE(scene.mesh.instancing);
  const auto x = [&](std::size_t triangle, float time) { return scene.mesh.corners(triangle, frame_at(time, 3))[0].x; };
  CHECK(x(0, 0.5f) == 10.25f);
  CHECK(x(1, 1.0f) == 1.5f);
  CHECK(x(2, 0.5f) == 0.375f);  // two frames in a scene of three
  CHECK(x(3, 0.7f) == 0.5f);
  CHECK_THAT(error_of([&] {
               (void)load_file(folder.write("t.yaml", "meshes: [{keyframes: [a.obj, b.obj]}]\nshutter: [0, 2]\n"));
             }),
             Catch::Contains("t.yaml:2: the shutter [0, 2] must lie within [0, 1]"));
  const Scene still = load_file(folder.write("u.yaml", "meshes: [{keyframes: [a.obj, b.obj]}]\nshutter: [0.5, 0.5]\n"));
  CHECK_FALSE(still.mesh.moves());
  CHECK(still.mesh.vertices[0].x == 0.125f);
  CHECK(still.report.warnings.size() == 1);
  SceneSpec spec;
  spec.scene = folder.path() / "s.yaml";
  CHECK(scene_moves(spec));
  spec.scene = folder.path() / "u.yaml";
  CHECK_FALSE(scene_moves(spec));
}

TEST_CASE("a structure that holds one moment takes no mesh that moves") {
  const TriangleMesh mesh = wandering(random_triangles(5, 0.3f, 1), 3, 0.1f, 1);
  BuildReport report;
  for (const StructureEntry& entry : all_structures()) {
    if (entry.info.holds_motion) continue;
    INFO(entry.info.name);
    BuildSettings settings;
    settings.builder = entry.info.builders.front(), settings.leaf = entry.info.leaves.front();
    CHECK_THAT(error_of([&] { (void)build_structure(entry.info.name, mesh, settings, report); }),
               Catch::Contains("holds one moment, and the mesh has 3 key frames"));
  }
}
