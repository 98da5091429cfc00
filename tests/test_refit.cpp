// Refit: a structure fitted to moved vertices answers as the moved mesh does, bit for bit.
#include <tbb/task_arena.h>

#include "core/error.h"
#include "structures/builders/builders.h"
#include "structures/builders/refit.h"
#include "structures/bvh/bvh.h"
#include "tests/catch.h"
#include "tests/error_of.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

/// The mesh wound about the z axis, pushed aside and shaken: every triangle is another.
TriangleMesh deformed(TriangleMesh mesh) {
  const Bounds3f box = mesh.bounds();
  const Vec3f centre = box.center(), extent = box.extent();
  const float size = std::max({extent.x, extent.y, extent.z});
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    Vec3f& v = mesh.vertices[i];
    const Vec3f d = v - centre;
    const float angle = 2.0f * d.z / size, c = std::cos(angle), s = std::sin(angle);
    const Vec3f shake = uniform_point(17, i, 0, {{-1, -1, -1}, {1, 1, 1}}) * (0.02f * size);
    v = centre + Vec3f{c * d.x - s * d.y, s * d.x + c * d.y, d.z} + shake + Vec3f{0.3f * size, 0, 0};
  }
  return mesh;
}

bool can_refit(std::string_view structure) { return find_structure(structure)->info.can_refit; }

}  // namespace

TEST_CASE("a refitted structure answers as brute force on the moved mesh, bit for bit") {
  for (const KernelScene& scene : kernel_scenes()) {
    const TriangleMesh moved = deformed(scene.mesh);
    std::vector<Ray> rays = generic_rays(moved, 200, 3);
    const Bounds3f box = moved.bounds();
    const std::vector<Ray> aimed = aimed_rays(moved, box.center() + box.extent() * 2.0f, 200, 4);
    rays.insert(rays.end(), aimed.begin(), aimed.end());
    Structures reference(moved);
    std::map<std::pair<std::string_view, std::string_view>, std::unique_ptr<Accel>> refitted;
    std::map<const KernelRow*, std::pair<std::vector<Hit>, std::vector<std::uint8_t>>> wanted;
    for (const KernelRow& row : runnable_rows()) {
      if (row.box != "padded" || !can_refit(row.structure)) continue;
      const KernelRow* brute = find_kernel("brute_force", row.leaf, row.intersector, row.box, "single", row.isa);
      if (!brute) continue;
      INFO(scene.name << ": " << name_of(row));
      std::unique_ptr<Accel>& accel = refitted[{row.structure, row.leaf}];
      if (!accel) {
        BuildSettings settings;
        settings.leaf = row.leaf, settings.isa = best_isa();
        BuildReport report;
        accel = build_structure(row.structure, scene.mesh, settings, report);
        accel->refit(moved);
      }
      auto& [hits, occluded] = wanted[brute];
      if (hits.empty())
        hits = closest_hit(*brute, reference.get(*brute), rays),
        occluded = any_hit(*brute, reference.get(*brute), rays);
      REQUIRE(same_bits(closest_hit(row, *accel, rays), hits));
      REQUIRE(any_hit(row, *accel, rays) == occluded);
    }
  }
}

TEST_CASE("refitting with the unmoved mesh changes nothing, whatever the threads") {
  const TriangleMesh mesh = random_triangles(30000, 0.05f, 8);
  const TriangleMesh moved = deformed(mesh);
  for (const std::string_view structure : {"bvh2", "bvh4", "bvh8", "bvh16"}) {
    INFO(structure);
    for (unsigned threads : {1u, 2u}) {
      BuildSettings settings;
      settings.leaf = "triangle4v";
      BuildReport report;
      const auto accel = build_structure(structure, mesh, settings, report);
      const auto& tree = dynamic_cast<const bvh::BvhBase&>(*accel);
      const std::vector<std::byte> before(tree.base(), tree.base() + tree.bytes());
      tbb::task_arena(int(threads), 1).execute([&] { accel->refit(moved), accel->refit(mesh); });
      CHECK(std::equal(before.begin(), before.end(), tree.base()));
    }
  }
}

TEST_CASE("refit says what it cannot do, and then leaves the structure as it was") {
  const TriangleMesh mesh = random_triangles(500, 0.2f, 9);
  BuildSettings settings;
  BuildReport report;
  const auto accel = build_structure("bvh8", mesh, settings, report);
  TriangleMesh fewer = mesh;
  fewer.triangles.pop_back();
  CHECK_THROWS_WITH(accel->refit(fewer), Catch::Contains("500 triangles"));
  TriangleMesh broken = mesh;
  broken.vertices[7].y = std::numeric_limits<float>::quiet_NaN();
  CHECK_THROWS_WITH(accel->refit(broken), Catch::Contains("not finite"));
  broken.vertices[7].y = 3e12f;
  CHECK_THROWS_WITH(accel->refit(broken), Catch::Contains("beyond 2^40"));
  broken = mesh, broken.vertices.resize(30);
  CHECK_THROWS_WITH(accel->refit(broken), Catch::Contains("names vertex 30 of 30"));
  CHECK_THROWS_WITH(build_structure("bvh8", broken, settings, report), Catch::Contains("names vertex 30 of 30"));
  broken = mesh, broken.later_frames.resize(1);
  CHECK_THROWS_WITH(accel->refit(broken), Catch::Contains("key frame 1 has 0 vertices"));
  settings.leaf = "triangle1", settings.builder = "in_order";
  CHECK_THROWS_WITH(build_structure("brute_force", mesh, settings, report)->refit(mesh),
                    Catch::Contains("cannot be refitted"));
  const auto empty = build_structure("bvh8", {}, BuildSettings{}, report);
  CHECK_NOTHROW(empty->refit(TriangleMesh{}));
}

TEST_CASE("the wide BVHs can be refitted, and what cannot says so") {
  const TriangleMesh mesh = random_triangles(200, 0.2f, 4);
  std::set<std::string_view> able;
  for (const StructureEntry& entry : all_structures()) {
    INFO(entry.info.name);
    if (entry.info.can_refit) able.insert(entry.info.name);
    BuildSettings settings;
    settings.builder = entry.info.builders.front(), settings.leaf = entry.info.leaves.front();
    settings.isa = best_isa();
    if (entry.info.name == "embree" && settings.isa == Isa::scalar) continue;
    BuildReport report;
    const auto accel = build_structure(entry.info.name, mesh, settings, report);
    double seconds = 1.0;
    const std::string error = error_of([&] { seconds = refit_structure(*accel, mesh, 1); });
    CHECK(seconds > 0.0);
    CHECK(error == (entry.info.can_refit ? "" : std::string(entry.info.name) + " cannot be refitted; build it anew"));
  }
  CHECK(able ==
        std::set<std::string_view>{"bvh2", "bvh4", "bvh8", "bvh16", "bvh4_aos", "bvh4_quantised", "bvh8_quantised"});
}

TEST_CASE("a binary tree is refitted") {
  const TriangleMesh mesh = random_triangles(20000, 0.05f, 10), moved = deformed(mesh);
  for (const std::string_view builder : binary_builder_names()) {
    INFO(builder);
    BuildSettings settings;
    settings.builder = builder;
    BinaryTree tree;
    BuildReport report;
    build_binary_tree(mesh, settings, 4, tree, report);
    refit(tree, moved);
    const Bounds3f whole = moved.bounds();
    CHECK(Bounds3f{tree.nodes[0].lower, tree.nodes[0].upper} == whole);
    std::size_t wrong = 0;
    std::vector<std::uint32_t> stack{0};
    while (!stack.empty()) {
      const std::uint32_t index = stack.back();
      stack.pop_back();
      const BinaryNode& node = tree.nodes[index];
      Bounds3f box;
      if (node.is_leaf()) {
        for (std::uint32_t i = 0; i < node.count; ++i) box.extend(moved.bounds(tree.primitives[tree.first[index] + i]));
      } else {
        for (std::uint32_t child : {node.left, node.left + 1})
          box.extend({tree.nodes[child].lower, tree.nodes[child].upper}), stack.push_back(child);
      }
      wrong += !(box == Bounds3f{node.lower, node.upper});
    }
    CHECK(wrong == 0);
  }
}
