// Packets through grids: the answers of single rays and of exact arithmetic, bit for bit, whatever rays a packet is of,
// and what its rays share.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/random.h"
#include "oracle/oracle.h"
#include "structures/accel.h"
#include "tests/catch.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"
#include "traversal/kernel_table.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

/// The leaf that packets of 32 and 64 rays have compiled in; the other ways call its tests.
std::string leaf_of(Isa isa) { return std::string(default_leaf("grid", "exact", isa)); }

std::unique_ptr<Accel> grid_of(const TriangleMesh& mesh, std::string builder, Isa isa, float density) {
  BuildSettings settings;
  settings.builder = std::move(builder), settings.leaf = leaf_of(isa);
  settings.parameters.grid_density = density;
  BuildReport report;
  return build_structure("grid", mesh, settings, report);
}

const KernelRow& kernel(std::string_view traversal, Isa isa) {
  const KernelRow* row = find_kernel("grid", leaf_of(isa), "exact", "padded", traversal, isa);
  REQUIRE(row);
  return *row;
}

std::vector<Isa> vector_isas() {
  std::vector<Isa> isas(available_isas().begin(), available_isas().end());
  std::erase(isas, Isa::scalar);
  return isas;
}

/// Triangles in two crowds, so that the two-level grid has inner grids, and few between them.
TriangleMesh two_crowds() {
  TriangleMesh mesh = random_triangles(6000, 0.3f, 31);
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    Vec3f& v = mesh.vertices[i];
    const std::size_t triangle = i / 3;
    if (triangle % 8 == 0) {
      const Vec3f first = mesh.vertices[3 * triangle];
      v = first + (v - first) * 0.05f;
      continue;
    }
    v = v * 0.05f + (triangle % 2 ? Vec3f{0.6f, 0.5f, -0.4f} : Vec3f{-0.7f, 0.2f, 0.6f});
  }
  return mesh;
}

/// Rays of all kinds in one batch: bundles along each axis and diagonal, forwards and backwards, rays with zeros in
/// their directions, from inside and outside, short ones, ones that start beyond the walk's bounds, invalid ones.
std::vector<Ray> mixed_rays(const TriangleMesh& mesh, std::size_t count) {
  std::vector<Ray> rays;
  for (std::uint64_t i = 0; i < count; ++i) {
    const std::uint64_t bundle = i / 23;  // so that packets of any size have several
    const auto corners = mesh.corners(bundle * 97 % mesh.size());
    const Vec3f target = (corners[0] + corners[1] + corners[2]) * (1 / 3.0f);
    Vec3f along{};
    along[bundle % 3] = bundle % 2 ? 1.0f : -1.0f;
    if (bundle % 5 == 1) along = uniform_point(42, bundle, 0, {{-1, -1, -1}, {1, 1, 1}});
    if (bundle % 5 == 2) along = uniform_point(43, i, 0, {{-1, -1, -1}, {1, 1, 1}});
    const Vec3f spread = uniform_point(44, i, 0, {{-0.02f, -0.02f, -0.02f}, {0.02f, 0.02f, 0.02f}});
    const float away = i % 7 == 3 ? 0.0f : i % 7 == 5 ? 300.0f : 3.0f;
    Ray ray{target + spread - along * away, 0, along + (bundle % 3 ? spread * 0.1f : Vec3f{}), kInfinity};
    if (i % 11 == 4) ray.tfar = 3.2f;
    if (i % 11 == 6) ray.tnear = 2.9f;
    if (i % 29 == 13) ray.direction = {};
    if (i % 31 == 17) ray.tnear = std::numeric_limits<float>::quiet_NaN();
    rays.push_back(ray);
  }
  return rays;
}

}  // namespace

TEST_CASE("packets through grids give the exact answers, whatever rays they are of") {
  const TriangleMesh mesh = two_crowds();
  const std::vector<Ray> rays = mixed_rays(mesh, 3000);
  const std::vector<ExactHit> truth = Oracle(mesh).closest_hit(rays);
  const auto hits_of_truth = std::ranges::count_if(truth, [](const ExactHit& h) { return h.hit.is_hit(); });
  CHECK(hits_of_truth > 600);
  CHECK(std::size_t(hits_of_truth) < rays.size());
  for (const char* builder : {"two_level", "uniform"}) {
    for (const Isa isa : vector_isas()) {
      const auto accel = grid_of(mesh, builder, isa, builder == std::string_view("uniform") ? 8.0f : 1.0f);
      for (const char* traversal :
           {"packet4", "packet8", "packet16", "packet32", "packet64", "hybrid4", "hybrid8", "hybrid16", "auto"}) {
        const KernelRow& row = kernel(traversal, isa);
        INFO(builder << ", " << name_of(row));
        const std::vector<Hit> hits = closest_hit(row, *accel, rays);
        const std::vector<std::uint8_t> occluded = any_hit(row, *accel, rays);
        std::size_t wrong = 0;
        for (std::size_t i = 0; i < rays.size(); ++i) {
          const Hit& expected = truth[i].hit;
          wrong += hits[i].primitive != expected.primitive || (expected.is_hit() && hits[i].t != expected.t) ||
                   (occluded[i] != 0) != expected.is_hit();
        }
        CHECK(wrong == 0);
      }
    }
  }
}

TEST_CASE("rays of a packet that are close together share a grid's levels and leaves") {
  const TriangleMesh mesh = two_crowds();
  std::vector<Ray> bundle;
  for (int i = 0; i < 64; ++i)  // into one of the crowds
    bundle.push_back({{0.6f + 0.001f * float(i % 8), 0.5f + 0.001f * float(i / 8), -3}, 0, {0, 0, 1}, kInfinity});
  for (const Isa isa : vector_isas()) {
    INFO(to_string(isa));
    const auto accel = grid_of(mesh, "two_level", isa, 1.0f);
    Counters alone, together, apart;
    const std::vector<Hit> expected = closest_hit(kernel("single", isa), *accel, bundle, &alone);
    CHECK(std::ranges::all_of(expected, [](const Hit& h) { return h.is_hit(); }));
    (void)closest_hit(kernel("packet64", isa), *accel, bundle, &together);
    CHECK(together.packets == 1);
    CHECK(together.rays_in_packets == 64);
    // Every ray comes to the outer level and to the inner one of its crowd, as it does alone.
    CHECK(together.nodes == alone.nodes);
    CHECK(alone.nodes >= 2 * 64);
    CHECK(together.nodes - together.nodes_shared <= 8);
    CHECK(together.leaves >= alone.leaves);
    CHECK(double(together.leaves) < 2.0 * double(alone.leaves));
    CHECK(together.boxes_hit >= together.leaves);
    CHECK(together.boxes >= together.boxes_hit);
    CHECK(together.lanes >= together.lanes_active);
    // Rays that look in all directions share hardly anything.
    std::vector<Ray> sphere;
    for (std::uint64_t i = 0; i < 64; ++i)
      sphere.push_back({{0, 0, 0}, 0, uniform_point(51, i, 0, {{-1, -1, -1}, {1, 1, 1}}), kInfinity});
    (void)closest_hit(kernel("packet64", isa), *accel, sphere, &apart);
    const auto rays_a_leaf = [](const Counters& c) { return double(c.leaves) / double(c.leaves - c.leaves_shared); };
    CHECK(rays_a_leaf(together) > 2 * rays_a_leaf(apart));
  }
}

TEST_CASE("a hybrid's last rays in a grid go on alone from the slice where they are left") {
  const TriangleMesh mesh = two_crowds();
  std::vector<Ray> rays;  // one of sixteen reaches the crowd; the others end before
  for (int i = 0; i < 16; ++i)
    rays.push_back({{0.6f + 0.001f * float(i), 0.5f, -3}, 0, {0, 0, 1}, i == 5 ? kInfinity : 2.1f});
  for (const Isa isa : vector_isas()) {
    INFO(to_string(isa));
    const auto accel = grid_of(mesh, "two_level", isa, 1.0f);
    Counters packet, hybrid;
    const std::vector<Hit> expected = closest_hit(kernel("single", isa), *accel, rays);
    REQUIRE(expected[5].is_hit());
    CHECK(closest_hit(kernel("packet16", isa), *accel, rays, &packet)[5].t == expected[5].t);
    CHECK(closest_hit(kernel("hybrid16", isa), *accel, rays, &hybrid)[5].t == expected[5].t);
    CHECK(packet.rays_alone == 0);
    CHECK(hybrid.rays_alone == 1);
    CHECK(hybrid.switches == 1);
  }
}
