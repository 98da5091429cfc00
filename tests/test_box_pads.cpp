// Scenes of which a few triangles are far larger than the others: boxes that hold those are wider, and pads of all
// others are as small as if they were alone (structures/box_pads.h).
#include "structures/box_pads.h"

#include <set>

#include "core/coordinates.h"
#include "tests/structure_cases.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

constexpr Bounds3f kDetail{{-1, -1, -1}, {1, 1, 1}};

/// Small triangles within kDetail, and below them a ground of two that reaches `size` far.
TriangleMesh over_ground(std::size_t small, float size) {
  TriangleMesh mesh = random_triangles(small, 0.02f, 5);
  add_triangle(mesh, {-size, -1.5f, -size}, {size, -1.5f, -size}, {-size, -1.5f, size});
  add_triangle(mesh, {size, -1.5f, -size}, {size, -1.5f, size}, {-size, -1.5f, size});
  return mesh;
}

std::vector<Ray> near_rays(std::size_t count) {
  const Bounds3f around{{-3, -1.4f, -3}, {3, 3, 3}};
  std::vector<Ray> rays;
  for (std::uint64_t i = 0; i < count; ++i)
    rays.push_back(through(uniform_point(7, i, 0, around), uniform_point(7, i, 3, kDetail)));
  return rays;
}

BoxPads pads_of(const TriangleMesh& mesh) { return BoxPads(mesh, mesh.bounds()); }

/// Of boxes that are padded, so whether a ray enters depends on the pads.
constexpr std::string_view kWithPads[] = {"bvh2",           "bvh4",           "bvh8", "bvh16", "bvh4_aos",
                                          "bvh4_quantised", "bvh8_quantised", "bih",  "kdtree"};

}  // namespace

TEST_CASE("pads are for the scene's largest coordinate where that is a common one") {
  const Vec3f offset{1e5f, 0, 0};
  for (const TriangleMesh& mesh : {random_triangles(5000, 0.02f, 5),
                                   moved(random_triangles(500, 0.1f, 3), 1.0f, offset), over_ground(5000, 20.0f)}) {
    const BoxPads pads = pads_of(mesh);
    const Bounds3f box = mesh.bounds();
    CHECK(pads.common() == largest_coordinate(box));
    CHECK_FALSE(pads.any());
    CHECK(pads.widened(box) == box);
  }
  CHECK(BoxPads(TriangleMesh{}, Bounds3f{}).common() == 0.0f);
}

TEST_CASE("where few triangles have the largest coordinates pads are smaller, and their boxes wider") {
  for (const float size : {1e3f, 1e6f, 0x1p39f, 0x1p100f, 0x1p126f}) {
    const TriangleMesh mesh = over_ground(5000, size);
    const BoxPads pads = pads_of(mesh);
    CAPTURE(size, pads.common());
    CHECK(pads.any());
    CHECK(pads.common() < size);
    CHECK(pads.common() >= 0x1p-32f * size);
    CHECK(pads.common() >= 16.0f);
    CHECK(pads.common() <= std::max(64.0f, 0x1p-32f * size));
    CHECK(pads.widened(kDetail) == kDetail);
    CHECK(pads.widened(Bounds3f{}).empty());
    const Bounds3f box = mesh.bounds(), wide = pads.widened(box);
    // As much as the pads of common() lack at least, and not noticeably more
    const double lacking = 0x1p-19 * (double(size) - double(pads.common()));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      CAPTURE(axis);
      const double below = double(box.lower[axis]) - double(wide.lower[axis]),
                   above = double(wide.upper[axis]) - double(box.upper[axis]);
      CHECK(std::isfinite(wide.lower[axis]));
      CHECK(std::isfinite(wide.upper[axis]));
      CHECK(std::min(below, above) >= lacking);
      CHECK(std::max(below, above) <= 1.1 * lacking);
    }
  }
}

TEST_CASE("where floats end no box is wider, and pads are for the scene's largest coordinate") {
  constexpr float kMost = std::numeric_limits<float>::max();
  TriangleMesh mesh = random_triangles(200, 0.1f, 5);
  add_triangle(mesh, {kMost, -1, -1}, {kMost, 2, -1}, {kMost, -1, 2});
  CHECK_FALSE(pads_of(mesh).any());
  CHECK(pads_of(mesh).common() == kMost);
  // From far before the last plane to it, tnear at the hit: its box must be met there.
  std::vector<Ray> rays;
  for (std::uint64_t i = 0; i < 300; ++i) {
    Ray ray{uniform_point(7, i, 0, {{-0x1p102f, 0, 0}, {0, 0.5f, 0.5f}}), 0.0f, {0x1p100f, 0, 0}, kInfinity};
    ray.tnear = float((double(kMost) - double(ray.origin.x)) / 0x1p100);
    rays.push_back(ray);
  }
  Structures structures(mesh);
  std::size_t rows = 0, hits = 0;
  for (const KernelRow& row : kernel_table()) {
    if (!is_available(row.isa) || row.box != "padded" || row.intersector != "exact" ||
        std::ranges::find(kWithPads, row.structure) == std::end(kWithPads) ||
        row.leaf != default_leaf(row.structure, row.intersector, row.isa))
      continue;
    INFO(name_of(row));
    const KernelRow* alone = find_kernel("brute_force", row.leaf, row.intersector, row.box, "single", row.isa);
    if (!alone) continue;
    const std::vector<Hit> expected = closest_hit(*alone, structures.get(*alone), rays);
    CHECK(same_bits(closest_hit(row, structures.get(row), rays), expected));
    ++rows;
    for (const Hit& hit : expected) hits += hit.is_hit();
  }
  CHECK(rows >= 40);
  CHECK(hits >= rows);
}

TEST_CASE("a ground that reaches to the horizon: every structure's answers are those without one") {
  for (const float size : {1e6f, 0x1p39f}) {
    INFO("a ground of " << size);
    const TriangleMesh mesh = over_ground(3000, size);
    std::vector<Ray> rays = near_rays(100);
    for (const Vec3f from : {Vec3f{0.1f, 2, 0.2f}, Vec3f{0.3f * size, 0.1f * size, -0.2f * size}})
      for (const Ray& ray : aimed_rays(mesh, from, 100, 3)) rays.push_back(ray);
    for (std::uint64_t i = 0; i < 60; ++i) {  // down to the ground, and along an axis
      const Vec3f on_ground = uniform_point(9, i, 0, {{-size, -1.5f, -size}, {size, -1.5f, size}});
      rays.push_back(through(uniform_point(9, i, 3, kDetail), on_ground));
      Vec3f along{0, 0, 0};
      along[i % 3] = i & 1 ? -1.0f : 1.0f;
      rays.push_back({uniform_point(9, i, 6, kDetail), 0.0f, along, kInfinity});
    }
    for_each_combination(mesh, rays, Silhouettes::aimed_at);
  }
}

TEST_CASE("a ground that reaches to the horizon: rays with padded boxes test no more than with fast ones") {
  const TriangleMesh mesh = over_ground(20000, 1e6f);
  const std::vector<Ray> rays = near_rays(2000);
  std::size_t rows = 0;
  for (const Combination& combination : combinations()) {
    const StructureInfo& info = combination.entry->info;
    if (std::ranges::find(kWithPads, info.name) == std::end(kWithPads)) continue;
    INFO(combination.name());
    const auto accel = combination.build(mesh);
    for (const KernelRow* row : combination.rows) {
      if (row->box != "padded" || row->intersector != "watertight") continue;
      INFO(name_of(*row));
      const KernelRow* fast =
          find_kernel(row->structure, row->leaf, row->intersector, "fast", row->traversal, row->isa);
      REQUIRE(fast);
      Counters with_pads, without;
      static_cast<void>(closest_hit(*row, *accel, rays, &with_pads));
      static_cast<void>(closest_hit(*fast, *accel, rays, &without));
      CAPTURE(with_pads.triangles, without.triangles);
      CHECK(without.triangles > 0);
      CHECK(double(with_pads.triangles) <= 1.1 * double(without.triangles));
      ++rows;
    }
  }
  CHECK(rows >= 40);
}

TEST_CASE("a ground that reaches to the horizon: every way of traversal gives the single ray's answers, bit for bit") {
  for (const float size : {1e6f, 0x1p39f}) {
    INFO("a ground of " << size);
    const TriangleMesh mesh = over_ground(500, size);
    std::vector<Ray> rays = near_rays(200);
    for (const Ray& ray : aimed_rays(mesh, {0.3f * size, 0.1f * size, -0.2f * size}, 150, 4)) rays.push_back(ray);
    for (const Ray& ray : aimed_rays(mesh, {0.1f, 2, 0.2f}, 150, 5)) rays.push_back(ray);
    Structures structures(mesh);
    std::set<std::string_view> traversals;
    for (const KernelRow& row : kernel_table()) {
      if (row.box != "padded" || !is_available(row.isa) || row.isa == Isa::scalar || row.traversal == "single" ||
          std::ranges::find(kWithPads, row.structure) == std::end(kWithPads) ||
          (row.intersector != "watertight" && row.intersector != "moller_trumbore") ||
          row.leaf != default_leaf(row.structure, row.intersector, row.isa))
        continue;
      INFO(name_of(row));
      const KernelRow* single = find_kernel(row.structure, row.leaf, row.intersector, row.box, "single", row.isa);
      REQUIRE(single);
      const Accel& accel = structures.get(row);
      REQUIRE(same_bits(closest_hit(row, accel, rays), closest_hit(*single, accel, rays)));
      REQUIRE(any_hit(row, accel, rays) == any_hit(*single, accel, rays));
      traversals.insert(row.traversal);
    }
    CHECK(traversals.size() >= 15);
  }
}
