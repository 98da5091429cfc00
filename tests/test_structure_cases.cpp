// Structure-level cases B01 to B07: scenes of few, equal or concentric triangles, and of sizes far apart.
#include <cmath>

#include "tests/structure_cases.h"

using namespace arboretum;
using namespace arboretum::test;

TEST_CASE("every structure has combinations, and each of them rows that trace it") {
  std::size_t structures = 0;
  for (const StructureEntry& entry : all_structures()) {
    if (entry.info.name == "embree") continue;
    INFO(entry.info.name);
    CHECK(std::ranges::any_of(combinations(), [&](const Combination& c) { return c.is(entry.info.name); }));
    ++structures;
  }
  CHECK(structures >= 2);
  for (const Combination& c : combinations()) {
    INFO(c.name());
    CHECK(std::ranges::any_of(
        c.rows, [](const KernelRow* row) { return row->box == "padded" && row->intersector == "watertight"; }));
  }
}

TEST_CASE("B01: an empty scene builds, every ray misses, nothing is shown with bounds") {
  TriangleMesh vertices_alone;
  vertices_alone.vertices = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  const std::vector<Ray> rays = generic_rays(random_triangles(5, 0.5f, 1), 50, 2);
  for (const TriangleMesh& mesh : {TriangleMesh{}, vertices_alone}) {
    for_each_combination(
        mesh, rays, [&](const Combination& combination, const Accel& accel, const StructureStatistics& statistics) {
          CHECK(statistics.references == 0);
          struct Bounds final : StructureVisitor {
            void node(const NodeView& node) override {
              all.extend(node.bounds);
              for (const Bounds3f& b : node.child_bounds) all.extend(b);
            }
            void leaf(const LeafView& leaf) override {
              if (!leaf.primitives.empty()) all.extend(leaf.bounds);
            }
            Bounds3f all;
          } bounds;
          REQUIRE(accel.visit(bounds));
          CHECK(bounds.all.empty());
          for (const KernelRow* row : combination.rows)
            for (const Hit& hit : closest_hit(*row, accel, rays))
              CHECK(same_bits(std::span(&hit, 1), std::vector<Hit>{Hit{}}));
        });
  }
}

TEST_CASE("B02: one triangle is one leaf with one reference") {
  const TriangleMesh mesh = random_triangles(1, 0.8f, 4);
  std::vector<Ray> rays = generic_rays(mesh, 100, 1);
  for (const Ray& ray : aimed_rays(mesh, {3, 4, 5}, 100, 2)) rays.push_back(ray);
  for_each_combination(
      mesh, rays,
      [&](const Combination& combination, const Accel&, const StructureStatistics& statistics) {
        CHECK(statistics.references >= 1);
        if (combination.entry->info.root_is_node) {
          CHECK(statistics.nodes >= 1);
          return;
        }
        CHECK(statistics.nodes == 0);
        CHECK(statistics.leaves == 1);
        CHECK(statistics.references == 1);
      },
      Silhouettes::aimed_at);
}

TEST_CASE("B03: two triangles of a square with its corner in the origin") {
  const float s = 0.119995f;
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 0}, {0, -s, 0}, {s, -s, 0}, {s, 0, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
  std::vector<Ray> rays;
  for (std::uint64_t i = 0; i < 200; ++i)
    rays.push_back(
        through({0.03f, -0.05f, 1}, uniform_point(3, i, 0, {{0.001f, 0.001f - s, 0}, {s - 0.001f, -0.001f, 0}})));
  for (const Vec3f& v : mesh.vertices) rays.push_back({v + Vec3f{0, 0, 1}, 0, {0, 0, -1}, kInfinity});
  rays.push_back({{s / 2, -s / 2, 1}, 0, {0, 0, -1}, kInfinity});
  for_each_combination(mesh, rays, [&](const Combination& combination, const Accel& accel, const StructureStatistics&) {
    for (const KernelRow* row : combination.rows) {
      if (row->intersector != "watertight" || row->box != "padded") continue;
      for (const Hit& hit : closest_hit(*row, accel, rays)) CHECK(hit.is_hit());
    }
  });
}

TEST_CASE("B04: one to five triangles, and a wide node with empty lanes") {
  for (std::size_t n = 1; n <= 17; n += n < 5 ? 1 : 4) {
    INFO(n << " triangles");
    const TriangleMesh mesh = moved(random_triangles(n, 0.3f, 60 + n), 1.0f, {0.1f, 0, -2});
    for_each_combination(mesh, generic_rays(mesh, 150, n));
  }
}

TEST_CASE("B05: k copies of one triangle: ends, and the lowest id answers") {
  for (const std::size_t k : {2u, 3u, 10u, 100u, 10000u}) {
    INFO(k << " copies");
    const TriangleMesh mesh = repeated(random_triangles(1, 0.8f, 4), k);
    const auto c = mesh.corners(0);
    std::vector<Ray> rays = generic_rays(mesh, 40, 1);
    rays.push_back(through({3, 2, 1}, (c[0] + c[1] + c[2]) * (1.0f / 3)));
    for_each_combination(
        mesh, rays, [&](const Combination& combination, const Accel& accel, const StructureStatistics& statistics) {
          CHECK(statistics.references >= k);
          CHECK(statistics.depth <= 64);
          for (const KernelRow* row : combination.rows) {
            if (row->box != "padded") continue;
            INFO(name_of(*row));
            CHECK(closest_hit(*row, accel, std::span(rays).last(1))[0].primitive == 0);
          }
        });
  }
}

TEST_CASE("B06: concentric triangles, each twice as large as the one before, all with the same centroid") {
  TriangleMesh mesh;
  for (int i = -23; i <= 38; ++i) {  // kMaxCoordinate is 2^40
    const float s = std::ldexp(1.0f, i);
    add_triangle(mesh, {-s, -s, 0}, {s, -s, 0}, {0, 2 * s, 0});
  }
  std::vector<Ray> rays;
  for (int i = -23; i <= 38; ++i) {
    const float s = std::ldexp(1.0f, i);
    rays.push_back({{0, 0.75f * s, 1}, 0, {0, 0, -1}, kInfinity});
    rays.push_back({{0.25f * s, -0.9f * s, 2 * s}, 0, {0, 0, -s}, kInfinity});
    rays.push_back(through({-s, s, s}, {0, -0.5f * s, 0}));
  }
  for_each_combination(mesh, rays, [](const Combination&, const Accel&, const StructureStatistics& statistics) {
    CHECK(statistics.references <= 62u * 62u);
  });
}

TEST_CASE("B07: a triangle at each power of two: a tree as deep as the exponents' range, no stack overflow") {
  TriangleMesh mesh;
  std::vector<Ray> rays;
  for (int i = -60; i <= 38; ++i) {
    const float x = std::ldexp(1.0f, i), s = std::ldexp(1.0f, i - 2);
    add_triangle(mesh, {x, 0, 0}, {x + s, 0, 0}, {x, s, 0});
    rays.push_back({{x + 0.25f * s, 0.25f * s, 1}, 0, {0, 0, -1}, kInfinity});
  }
  for (std::size_t i = 0; i < 60; ++i) rays.push_back({{-1, 1e-9f * float(i), 0.5f}, 0, {1, 0, -0.41f}, kInfinity});
  for_each_combination(mesh, rays, [&](const Combination& combination, const Accel& accel, const StructureStatistics&) {
    for (const KernelRow* row : combination.rows) {
      if (row->intersector != "watertight" || row->box != "padded") continue;
      const std::vector<Hit> hits = closest_hit(*row, accel, std::span(rays).first(mesh.size()));
      for (std::size_t i = 0; i < hits.size(); ++i) CHECK(hits[i].primitive == i);
    }
  });
}
