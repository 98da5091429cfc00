// The kd-tree's rays: those in planes, flat cells and star-shaped scenes get the brute force's answers, and a packet's
// go where they would go alone.
#include <algorithm>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <set>
#include <span>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "oracle/oracle.h"
#include "structures/kdtree/kdtree.h"
#include "tests/kdtree_scenes.h"
#include "tests/kernel_runner.h"
#include "traversal/kernel_table.h"

using namespace arboretum;
using namespace arboretum::test::kd;
using arboretum::test::any_hit;
using arboretum::test::closest_hit;
using arboretum::test::flat_grid;
using arboretum::test::kInfinity;
using arboretum::test::name_of;
using arboretum::test::random_triangles;
using arboretum::test::runnable_rows;
using arboretum::test::same_bits;

namespace {

/// Rays at inner points, corners and edges of triangles; along axes; and in planes of the tree, whose places are
/// coordinates of the mesh: from before, inside and beside them.
std::vector<Ray> rays_for(const TriangleMesh& mesh, std::size_t count) {
  std::vector<Ray> rays;
  const Vec3f extent = mesh.bounds().extent();
  for (std::size_t i = 0; i < count; ++i) {
    Dice dice(1000 + i);
    const auto c = mesh.corners(std::size_t(dice.integer(int(mesh.size()))));
    const auto other = mesh.corners(std::size_t(dice.integer(int(mesh.size()))));
    const float s = dice.uniform(0.1f, 0.6f);
    const Vec3f at = i % 4 == 0   ? c[i % 3]
                     : i % 4 == 1 ? c[0] * s + c[1] * (1 - s)
                                  : c[0] * s + c[1] * (0.9f - s) + c[2] * 0.1f;
    const float size = length(c[1] - c[0]) + length(c[2] - c[0]);
    Vec3f from = i % 3 == 0   ? at + dice.point() * (4 * size)
                 : i % 3 == 1 ? other[0]
                              : at + dice.point() * length(extent);
    if (i % 5 == 0) {  // along an axis, through a vertex of the mesh
      const std::size_t axis = i / 5 % 3;
      from = at, from[axis] -= (i % 2 ? 1.0f : -1.0f) * (extent[axis] + size);
    }
    if (i % 5 == 1) from[i / 5 % 3] = at[i / 5 % 3];  // within a plane at a coordinate of the mesh
    Vec3f direction = at - from;
    if (i % 7 == 0)
      for (std::size_t k = 0; k < 3; ++k) direction[k] = direction[k] == 0 ? -0.0f : direction[k];
    if (direction == Vec3f{}) direction = {0, 0, 1};
    rays.push_back({from, i % 6 == 5 ? 0.5f : 0.0f, direction, i % 6 == 4 ? 1.0f : kInfinity});
  }
  return rays;
}

/// Numbers at the ends of float's range: planes are met at distances that overflow, vanish or are no number at all.
std::vector<Ray> extreme_rays(const TriangleMesh& mesh) {
  constexpr float kMax = std::numeric_limits<float>::max(), kLeast = std::numeric_limits<float>::denorm_min();
  const Vec3f at = mesh.bounds().center(), low = mesh.bounds().lower;
  std::vector<Ray> rays;
  for (float size : {1e-38f, kLeast, 1e-30f, 1e30f, 1e38f}) {
    rays.push_back({at, 0, {size, size, -size}, kInfinity}), rays.push_back({low, 0, {0, size, 1}, kInfinity});
    rays.push_back({at, 0, {1, -size, 1}, kInfinity}), rays.push_back({{size, at.y, at.z}, 0, {-1, 0, 0}, kInfinity});
    rays.push_back({{low.x, size, -size}, 0, {size, -1, 1}, kInfinity}), rays.push_back({at, 0, {0, 0, -size}, size});
  }
  rays.push_back({{kMax, -kMax, kMax}, 0, {-kMax, kMax, -kMax}, kInfinity}),
      rays.push_back({{-kMax, 0, 0}, 0, {kLeast, 0, 0}, kInfinity});
  rays.push_back({at, kMax, {1, 1, 1}, kInfinity}), rays.push_back({at, 0, {1, 2, 3}, 0}),
      rays.push_back({at, kInfinity, {1, 0, 0}, kInfinity});
  return rays;
}

/// Rays that share a way for a while: from one point to a patch of the mesh's bounds, in one octant where `eye` is far
/// enough.
std::vector<Ray> fan(const TriangleMesh& mesh, Vec3f eye, float spread, unsigned side) {
  std::vector<Ray> rays;
  const Vec3f extent = mesh.bounds().extent(), centre = mesh.bounds().center();
  for (unsigned i = 0; i < side * side; ++i) {
    const Vec3f target = centre + Vec3f{(float(i % side) / float(side) - 0.5f) * extent.x,
                                        (float(i / side) / float(side) - 0.5f) * extent.y, 0.01f * extent.z} *
                                      spread;
    rays.push_back({eye, 0, target - eye, kInfinity});
  }
  return rays;
}

/// The kd-tree's rows of packets and hybrids on every instruction set of this machine: both boxes, the two usual
/// intersectors, once a kernel.
std::vector<KernelRow> packet_rows() {
  std::vector<KernelRow> rows;
  std::set<std::tuple<std::string_view, std::string_view, std::string_view, Isa, ClosestHitFunction>> seen;
  for (const KernelRow& row : kernel_table()) {
    const bool packets = row.traversal.starts_with("packet") || row.traversal.starts_with("hybrid");
    const bool usual = row.intersector == "moller_trumbore" || row.intersector == "watertight";
    if (row.structure != "kdtree" || !packets || !usual || !is_available(row.isa)) continue;
    if (seen.insert({row.intersector, row.box, row.traversal, row.isa, row.timed.closest_hit}).second)
      rows.push_back(row);
  }
  return rows;
}

/// The trees of one mesh, each built once.
class Trees {
 public:
  explicit Trees(const TriangleMesh& mesh) : mesh_(mesh) {}
  [[nodiscard]] const Accel& get(const char* builder, std::string_view leaf) {
    std::unique_ptr<Accel>& accel = built_[{builder, leaf}];
    if (!accel) accel = build(mesh_, builder, leaf);
    return *accel;
  }

 private:
  const TriangleMesh& mesh_;
  std::map<std::pair<std::string_view, std::string_view>, std::unique_ptr<Accel>> built_;
};

}  // namespace

TEST_CASE("with padded planes both builders' trees give the brute force's answers, bit for bit") {
  for (const Scene& scene : hard_scenes()) {
    const std::vector<Ray> rays = rays_for(scene.mesh, 400);
    test::Structures structures(scene.mesh);
    test::Answers brute_force(structures, rays);
    Trees trees(scene.mesh);
    for (const KernelRow& row : runnable_rows()) {
      if (row.structure != "kdtree" || row.box != "padded" || row.leaf == "triangle1" || row.leaf == "triangle16")
        continue;
      // The others are wrong by more than planes are padded: where triangles are small beside the scene, and on
      // triangles seen along their planes, which they take for hit far beside the ray.
      const std::string_view name(scene.name);
      if (row.intersector != "watertight" && (name == "outlier" || name == "split regression")) continue;
      const KernelRow* reference = find_kernel("brute_force", row.leaf, row.intersector, row.box, "single", row.isa);
      if (!reference) continue;
      const test::Answers::Both& answers = brute_force.of(*reference);
      const std::vector<Hit>& want = answers.closest;
      for (const char* builder : kBuilders) {
        const Accel& accel = trees.get(builder, row.leaf);
        INFO(scene.name << ", " << builder << ": " << name_of(row));
        const std::vector<Hit> got = closest_hit(row, accel, rays);
        test::require_each(
            rays.size(),
            [&](std::size_t i) { return same_bits(std::span(got).subspan(i, 1), std::span(want).subspan(i, 1)); },
            [&](std::size_t i) { return test::text(got[i]) + "; brute force: " + test::text(want[i]); });
        CHECK(any_hit(row, accel, rays) == answers.any);
      }
    }
  }
}

TEST_CASE("a ray in a split plane sees the triangles of both sides") {
  // Two boxes' worth of triangles on both sides of x = 0, all touching it with an edge that the ray crosses.
  TriangleMesh mesh;
  for (int i = 0; i < 64; ++i) {
    const auto z = float(i);
    const float side = i % 2 ? 1.0f : -1.0f;
    add_triangle(mesh, {0, -1, z}, {0, 1, z}, {side, 0, z});
  }
  std::vector<Ray> rays;
  for (float zero : {0.0f, -0.0f}) {
    for (int i = 0; i < 64; ++i) rays.push_back({{zero, 0.25f, float(i) - 0.5f}, 0, {zero, zero, 1}, kInfinity});
    rays.push_back({{zero, 0.25f, 70}, 0, {zero, zero, -1}, kInfinity});
  }
  Trees trees(mesh);
  for (const KernelRow& row : runnable_rows()) {
    if (row.structure != "kdtree") continue;
    INFO(name_of(row));
    const std::vector<Hit> hits = closest_hit(row, trees.get("sweep_sah", row.leaf), rays);
    test::require_each(
        rays.size(),
        [&](std::size_t i) { return hits[i].primitive == std::uint32_t(std::min<std::size_t>(i % 65, 63)); },
        [&](std::size_t i) { return test::text(hits[i]); });
  }
}

TEST_CASE("a packet's rays visit just what they visit alone, and get the same bits, whatever their neighbours are") {
  std::size_t compared = 0, hits = 0;
  for (const Scene& scene : hard_scenes()) {
    const Vec3f centre = scene.mesh.bounds().center(), extent = scene.mesh.bounds().extent();
    std::vector<Ray> rays =
        fan(scene.mesh, centre + extent * 1.5f + Vec3f{1, 1, 1} * (0.1f * length(extent)), 0.7f, 12);
    const auto append = [&](const std::vector<Ray>& more) { rays.insert(rays.end(), more.begin(), more.end()); };
    append(rays_for(scene.mesh, 150)), append(fan(scene.mesh, centre, 1.0f, 9));
    std::size_t place = 2;
    for (const auto& others : {extreme_rays(scene.mesh), test::invalid_rays()})
      for (const Ray& ray : others) rays.insert(rays.begin() + std::ptrdiff_t(place % rays.size()), ray), place += 11;
    test::Structures structures(scene.mesh);
    struct Alone {
      std::vector<Hit> hits;
      std::vector<std::uint8_t> occluded;
      Counters counters[2];  ///< of closest and of any hit
    };
    std::map<std::pair<const KernelRow*, std::size_t>, Alone> known;  // of single rays, by the size of the batch
    for (const KernelRow& row : packet_rows()) {
      const KernelRow* single = find_kernel(row.structure, row.leaf, row.intersector, row.box, "single", row.isa);
      REQUIRE(single);
      const Accel& accel = structures.get(row);
      const std::size_t width = test::rays_of(row);
      for (std::size_t size : {std::size_t(1), width - 1, width, 2 * width + 3, rays.size()}) {
        INFO(scene.name << ": " << name_of(row) << ", batch of " << size);
        const std::span<const Ray> batch = std::span(rays).first(std::min(size, rays.size()));
        const auto [entry, is_new] = known.try_emplace({single, batch.size()});
        if (is_new) {
          entry->second.hits = closest_hit(*single, accel, batch, &entry->second.counters[0]);
          entry->second.occluded = any_hit(*single, accel, batch, &entry->second.counters[1]);
        }
        const auto& [want, occluded, alone] = entry->second;
        Counters together[2];
        REQUIRE(same_bits(closest_hit(row, accel, batch), want));
        REQUIRE(same_bits(closest_hit(row, accel, batch, &together[0]), want));
        REQUIRE(any_hit(row, accel, batch) == occluded);
        REQUIRE(any_hit(row, accel, batch, &together[1]) == occluded);
        for (int any : {0, 1}) {
          REQUIRE(together[any].nodes == alone[any].nodes);
          REQUIRE(together[any].children_hit == alone[any].children_hit);
          REQUIRE(together[any].leaves == alone[any].leaves);
          REQUIRE(together[any].blocks == alone[any].blocks);
          REQUIRE(together[any].packets == (batch.size() + width - 1) / width);
        }
        ++compared;
        hits += std::size_t(std::ranges::count_if(want, &Hit::is_hit));
      }
    }
  }
  CHECK(compared > 500);
  CHECK(hits > 20 * compared);
}

TEST_CASE("packets of a fan pass most nodes together") {
  const TriangleMesh mesh = random_triangles(20000, 0.02f, 3);
  test::Structures structures(mesh);
  const std::vector<Ray> rays = fan(mesh, mesh.bounds().center() + mesh.bounds().extent() * 1.5f, 0.2f, 64);
  for (const KernelRow& row : packet_rows()) {
    if (row.box != "padded") continue;
    INFO(name_of(row));
    Counters c;
    (void)closest_hit(row, structures.get(row), rays, &c);
    std::uint64_t visits = 0;
    for (const Counters::Depth& d : c.depths) visits += d.visits;
    CHECK(double(visits) < 0.6 * double(c.nodes));  // visits of packets or of rays alone, against those of rays
    CHECK((c.switches > 0) ==
          (row.traversal != "packet4" && row.traversal != "packet8" && row.traversal != "packet16"));
  }
}

TEST_CASE("axis-parallel rays and invalid rays visit a path at most") {
  const TriangleMesh mesh = flat_grid(128);  // 32 768 triangles
  test::Structures structures(mesh);
  const std::vector<Ray> rays{{{0, 0, 3}, 0, {0, 0, -1}, kInfinity}, {{0.5f, 0.25f, 3}, 0, {0, -0.0f, -1}, kInfinity}};
  for (const KernelRow& row : runnable_rows()) {
    if (row.structure != "kdtree") continue;
    Counters counters;
    (void)closest_hit(row, structures.get(row), rays, &counters);
    INFO(name_of(row));
    CHECK(counters.nodes < 300);
    Counters none;
    (void)closest_hit(row, structures.get(row), test::invalid_rays(), &none);
    CHECK(none.nodes == 0);
  }
}
