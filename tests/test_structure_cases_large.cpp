// Structure-level cases B08 to B16: flat, crowded, stretched and degenerate scenes that builders stumble over.
#include <cmath>
#include <cstring>

#include "core/error.h"
#include "scenes/layout.h"
#include "scenes/rescale.h"
#include "scenes/sanitise.h"
#include "scenes/scene.h"
#include "tests/structure_cases.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

/// Nodes, leaves and triangles that the counting kernels of a combination see a ray; the first watertight padded row.
Counters counted(const Combination& combination, const Accel& accel, std::span<const Ray> rays) {
  Counters counters;
  for (const KernelRow* row : combination.rows) {
    if (row->intersector != "watertight" || row->box != "padded" || row->traversal != "single") continue;
    (void)closest_hit(*row, accel, rays, &counters);
    break;
  }
  return counters;
}

}  // namespace

TEST_CASE("B08: a flat grid: hits at nodes, edge midpoints and cell centres, and few visits") {
  for (const std::uint32_t k : {1u, 3u, 5u, 7u}) {
    const std::uint32_t n = 1u << k;
    INFO(n << " by " << n << " cells");
    const TriangleMesh mesh = flat_grid(n);
    std::vector<Ray> rays;
    for (std::uint64_t i = 0; i < 150; ++i) {
      const auto half = [&](std::uint64_t d) { return float(random_bits(9, i, d) % (2 * n + 1)) / float(n) - 1.0f; };
      rays.push_back({{half(0), half(1), i % 2 ? 1.0f : -2.0f}, 0, {0, 0, i % 2 ? -1.0f : 1.0f}, kInfinity});
      if (i % 3 == 0) rays.back().direction = {-0.0f, -0.0f, rays.back().direction.z};
    }
    for_each_combination(mesh, rays,
                         [&](const Combination& combination, const Accel& accel, const StructureStatistics&) {
                           for (const KernelRow* row : combination.rows) {
                             if (row->intersector != "watertight" || row->box != "padded") continue;
                             for (const Hit& hit : closest_hit(*row, accel, rays)) REQUIRE(hit.is_hit());
                           }
                           if (combination.entry->info.flat) return;
                           const Counters c = counted(combination, accel, rays);
                           const double count = double(rays.size());
                           CAPTURE(double(c.nodes) / count, double(c.leaves) / count, double(c.triangles) / count);
                           CHECK(double(c.nodes + c.leaves) / count <= 12.0 * (1.0 + std::log2(double(mesh.size()))));
                           CHECK(double(c.triangles) / count <= 300.0);
                         });
  }
}

TEST_CASE("B09: a thousand planes across the x axis: the nearest is hit, rays within a plane miss") {
  TriangleMesh mesh;
  std::vector<Ray> rays;
  for (int i = 0; i < 1024; ++i) add_triangle(mesh, {float(i), -1, -1}, {float(i), 3, -1}, {float(i), -1, 3});
  for (const float d : {0.0f, -0.0f}) {
    rays.push_back({{-1, 0, 0}, 0, {1, d, d}, kInfinity});
    rays.push_back({{2000, 0, 0}, 0, {-1, d, d}, kInfinity});
    for (const float x : {0.0f, 1.0f, 511.0f, 1023.0f}) {
      rays.push_back({{x, -9, 0}, 0, {d, 1, d}, kInfinity});
      rays.push_back({{x, 0, 9}, 0, {d, d, -1}, kInfinity});
      rays.push_back({{x, 0, 0}, 0, {1, d, d}, kInfinity});  // starts on a plane
    }
    rays.push_back({{0.5f, -9, 0}, 0, {d, 1, d}, kInfinity});
  }
  for_each_combination(mesh, rays, [&](const Combination& combination, const Accel& accel, const StructureStatistics&) {
    for (const KernelRow* row : combination.rows) {
      if (row->box != "padded") continue;
      const std::vector<Hit> hits = closest_hit(*row, accel, rays);
      CHECK(hits[0].primitive == 0);
      CHECK(hits[1].primitive == 1023);
      CHECK_FALSE(hits[2].is_hit());
      CHECK_FALSE(hits[3].is_hit());
    }
  });
}

TEST_CASE("B10: long diagonal slivers whose boxes all overlap") {
  TriangleMesh mesh;
  for (int i = 0; i < 1000; ++i) {
    const float y = std::ldexp(float(i), -20), e = 0x1p-22f;
    add_triangle(mesh, {0, y, 0}, {1, 1 + y, 1}, {1, 1 + y + e, 1});
  }
  std::vector<Ray> rays = aimed_rays(mesh, {2, -1, 0.5f}, 60, 5);
  for (const Ray& ray : generic_rays(mesh, 60, 6)) rays.push_back(ray);
  for_each_combination(
      mesh, rays,
      [&](const Combination& combination, const Accel& accel, const StructureStatistics& statistics) {
        const Counters c = counted(combination, accel, rays);
        CHECK(c.triangles <= rays.size() * std::max(statistics.references, mesh.size()));
      },
      Silhouettes::aimed_at);
}

TEST_CASE("B11: triangles that all straddle every plane through the middle: bounded depth and memory") {
  TriangleMesh mesh;
  for (std::uint64_t i = 0; i < 1500; ++i) {
    const Vec3f a = uniform_point(7, i, 0, {{-1, -1, -1}, {1, 1, 1}}),
                b = uniform_point(7, i, 3, {{-1, -1, -1}, {1, 1, 1}});
    add_triangle(mesh, a, a * -1.0f + b * 0.01f, b * 0.02f);
  }
  for_each_combination(mesh, generic_rays(mesh, 100, 6),
                       [&](const Combination&, const Accel& accel, const StructureStatistics& statistics) {
                         CAPTURE(statistics.references, statistics.depth, accel.bytes());
                         CHECK(statistics.depth <= 64);
                         CHECK(statistics.references <= 64 * mesh.size());
                         CHECK(accel.bytes() <= 8192 * mesh.size());
                       });
}

TEST_CASE("B12: point triangles by the thousand and one real: costs free of NaN, the real one is hit") {
  const auto scene = [](std::size_t points) {
    TriangleMesh mesh;
    for (std::size_t i = 0; i < points; ++i) {
      const Vec3f p = i % 2 ? Vec3f{0.25f, 0.5f, 0.75f} : uniform_point(3, i, 0, {{0, 0, 0}, {1, 1, 1}});
      add_triangle(mesh, p, p, p);
    }
    add_triangle(mesh, {0, 0, 0.5f}, {1, 0, 0.5f}, {0, 1, 0.5f});
    return mesh;
  };
  const TriangleMesh mesh = scene(20000);
  std::vector<Ray> rays = generic_rays(mesh, 100, 4);
  rays.push_back({{0.2f, 0.3f, -1}, 0, {0, 0, 1}, kInfinity});
  for_each_combination(mesh, rays,
                       [&](const Combination& combination, const Accel& accel, const StructureStatistics& statistics) {
                         CHECK(std::isfinite(statistics.sah_cost));
                         for (const KernelRow* row : combination.rows)
                           if (row->box == "padded")
                             CHECK(closest_hit(*row, accel, std::span(rays).last(1))[0].primitive == mesh.size() - 1);
                       });
  // A million of them, for the default builder of each structure.
  const TriangleMesh million = scene(1000000);
  std::string_view last;
  for (const Combination& combination : combinations()) {
    if (combination.entry->info.name == last || combination.entry->info.flat) continue;
    // One of the wide BVHs: they share the builder
    if (combination.entry->info.name.starts_with("bvh") && !combination.is("bvh8")) continue;
    last = combination.entry->info.name;
    INFO(combination.name());
    const auto accel = combination.build(million);
    for (const KernelRow* row : combination.rows)
      if (row->box == "padded")
        CHECK(closest_hit(*row, *accel, std::span(rays).last(1))[0].primitive == million.size() - 1);
  }
}

TEST_CASE("B13: one vertex at 1e12 beside eight thousand unit triangles") {
  TriangleMesh mesh = random_triangles(8000, 0.05f, 12);
  add_triangle(mesh, {1e12f, 0, 0}, {0, 2, 0}, {0, 2, 0.5f});
  std::vector<Ray> rays;
  const Bounds3f near{{-2, -2, -2}, {2, 2, 2}};
  for (std::uint64_t i = 0; i < 120; ++i)
    rays.push_back(through(uniform_point(5, i, 0, near), uniform_point(5, i, 3, near)));
  for (float x : {1e3f, 1e6f, 1e9f, 5e11f}) rays.push_back({{x, 2 - 2 * x / 1e12f, -1}, 0, {0, 0, 1}, kInfinity});
  for_each_combination(mesh, rays);
}

TEST_CASE("B14: a teapot in a stadium a thousand times its size") {
  const Scene scene = load_scene(parse_scene_word("teapot_in_stadium:4000"));
  const Bounds3f box = scene.mesh.bounds();
  std::vector<Ray> rays;
  for (std::uint64_t i = 0; i < 200; ++i) {
    const auto c = scene.mesh.corners(random_bits(5, i, 0) % scene.mesh.size());
    rays.push_back(through(uniform_point(5, i, 1, box), (c[0] + c[1] + c[2]) * (1.0f / 3)));
  }
  Reference reference(scene.mesh, rays);
  const AnswerCheck check = reference.check(reference.brute_force("watertight"));
  std::cout << "B14: t of watertight is off by " << check.t_error_ulp_p99 << " ulps at p99, " << check.t_error_ulp_max
            << " at most\n";
  CHECK(check.t_error_ulp_p99 <= 64.0);
  for_each_combination(scene.mesh, rays);
}

TEST_CASE("B15: coordinates beside a bin's border: no triangle is lost by splits and clips") {
  // The four numbers are those of Embree's regression test of triangle splits.
  const float values[] = {-6.4000024f, 25.6f, 34.0f, 57.6000022f};
  TriangleMesh mesh;
  for (int i = 0; i < 64; ++i) {
    for (int j = 1; j < 64; j += 9) {
      const auto point = [&](int k) { return Vec3f{values[k & 3], values[k >> 2 & 3], values[k >> 4 & 3]}; };
      const Vec3f a = point(i), b = point(i ^ j), c = point((i * 7 + j) & 63);
      if (a == b || b == c || c == a) continue;
      add_triangle(mesh, a, b, c);
    }
  }
  std::vector<Ray> rays = aimed_rays(mesh, {100, -50, 20}, 150, 3);
  for (const Ray& ray : generic_rays(mesh, 150, 4)) rays.push_back(ray);
  // The reference of each triangle is looked for in the leaves
  for_each_combination(mesh, rays, Silhouettes::aimed_at);
}

TEST_CASE("B16: a cluster within one Morton cell of the scene") {
  TriangleMesh mesh = moved(random_triangles(3000, 0.3f, 8), 0.5e-7f);
  add_triangle(mesh, {1, 1, 1}, {0.9f, 1, 1}, {1, 0.9f, 1});
  add_triangle(mesh, {-1, -1, -1}, {-0.9f, -1, -1}, {-1, -0.9f, -1});
  std::vector<Ray> rays = generic_rays(mesh, 60, 4);
  const Bounds3f cluster{{-1e-7f, -1e-7f, -1e-7f}, {1e-7f, 1e-7f, 1e-7f}};
  for (std::uint64_t i = 0; i < 100; ++i)
    rays.push_back(through(uniform_point(5, i, 0, cluster), uniform_point(5, i, 3, cluster)));
  for_each_combination(mesh, rays);
}

TEST_CASE("B18: vertices of random bits: refused as they are; sanitised, the valid ones are hit") {
  Scene scene;
  for (std::uint64_t i = 0; i < 9000; ++i) {
    Vec3f p;
    for (std::size_t k = 0; k < 3; ++k) {
      std::uint32_t bits = std::uint32_t(random_bits(77, i, k));
      if (i % 3000 > 1000) bits = (bits & 0x8fffffffu) | 0x30000000u;  // of two thirds the exponent is tame
      std::memcpy(&p[k], &bits, 4);
    }
    scene.mesh.vertices.push_back(p);
  }
  for (std::uint32_t i = 0; i < 9000; i += 3) scene.mesh.triangles.push_back({i, i + 1, i + 2});
  scene.mesh.materials.assign(scene.mesh.size(), 0);
  for (const Combination& combination : combinations()) CHECK_THROWS_AS(combination.build(scene.mesh), UserError);
  sanitise(scene, "B18");
  const LoadReport& report = scene.report;
  CHECK(report.non_finite > 0);
  CHECK(report.out_of_range > 0);
  CHECK(report.non_finite + report.out_of_range + report.degenerate + scene.mesh.size() == 3000);
  REQUIRE(scene.mesh.size() > 1000);
  std::vector<Ray> rays;
  for (std::uint64_t i = 0; i < 200; ++i) {
    const auto c = scene.mesh.corners(random_bits(5, i, 0) % scene.mesh.size());
    const float size = std::max({length(c[1] - c[0]), length(c[2] - c[0]), 1e-20f});
    rays.push_back(
        through((c[0] + c[1] + c[2]) * (1.0f / 3) + uniform_point(5, i, 1, {{-1, -1, -1}, {1, 1, 1}}) * size * 3.0f,
                (c[0] + c[1] + c[2]) * (1.0f / 3)));
  }
  // Beyond the extents that float32 predicates are safe for brute_force errs too: compared is where it does not.
  Reference reference(scene.mesh, rays);
  for (const Combination& combination : combinations()) {
    INFO(combination.name());
    const auto accel = combination.build(scene.mesh);
    (void)statistics_of(*accel, scene.mesh);
    for (const KernelRow* row : combination.rows) {
      if (row->box != "padded") continue;
      const std::vector<Hit> hits = closest_hit(*row, *accel, rays);
      const std::vector<Hit>& expected = reference.brute_force(row->intersector);
      std::size_t compared = 0;
      for (std::size_t i = 0; i < rays.size(); ++i) {
        if (expected[i].primitive != reference.truth()[i].hit.primitive) continue;
        ++compared;
        INFO(name_of(*row) << " ray " << i);
        CHECK(hits[i].primitive == expected[i].primitive);
      }
      CHECK(compared > rays.size() / 2);
    }
  }
}

TEST_CASE("instances of a scene that was out of range are answered as its flat mesh is") {
  const struct {
    float object;
    double scale;
  } sizes[] = {{1e13f, 1.0}, {1.0f, 1e-13}, {1.0f, 1e-41}, {1e-41f, 1.0}, {1e13f, 1e-26}};
  for (const auto& [object, scale] : sizes) {
    CAPTURE(object, scale);
    Layout layout;
    TriangleMesh ball = sphere(6);
    for (Vec3f& v : ball.vertices) v = v * object;
    const std::uint32_t part = layout.add_part(ball);
    for (int i = 0; i < 3; ++i) {
      const double c = scale * std::cos(i), s = scale * std::sin(i), apart = 1.5 * i * scale * double(object);
      layout.place(part, {{{c, -s, 0, apart}, {s, c, 0, 0}, {0, 0, scale, 0}}}, 0);
    }
    Scene scene;
    scene.mesh = layout.take(true);
    rescale(scene, "test"), sanitise(scene, "test");
    REQUIRE(scene.report.scaled_by != 0);
    REQUIRE(scene.mesh.instancing);
    CHECK(scene.mesh.instancing->instances.size() == 3);
    for_each_combination(scene.mesh, generic_rays(scene.mesh, 200, 6));
  }
}
