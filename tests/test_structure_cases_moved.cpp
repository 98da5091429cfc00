// Structure-level cases B28 to B30: what must not change when a scene is written down otherwise, moved or scaled.
#include <cmath>
#include <numeric>

#include "tests/structure_cases.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

/// A random order of n things.
std::vector<std::uint32_t> shuffled(std::uint32_t n, std::uint64_t seed) {
  std::vector<std::uint32_t> order(n);
  std::iota(order.begin(), order.end(), 0u);
  for (std::uint32_t i = n; i > 1; --i) std::swap(order[i - 1], order[random_bits(seed, i, 0) % i]);
  return order;
}

/// f(row, hits on one mesh, hits on another) for every combination's padded rows.
template <class F>
void compare(const TriangleMesh& one, std::span<const Ray> rays, const TriangleMesh& other,
             std::span<const Ray> other_rays, F&& f) {
  for (const Combination& combination : combinations()) {
    const auto a = combination.build(one), b = combination.build(other);
    for (const KernelRow* row : combination.rows) {
      if (row->box != "padded") continue;
      INFO(name_of(*row) << ", " << combination.builder);
      const std::vector<Hit> hits = closest_hit(*row, *a, rays), others = closest_hit(*row, *b, other_rays);
      REQUIRE(hits.size() == others.size());
      f(hits, others);
    }
  }
}

}  // namespace

TEST_CASE("B28: rotated corners and turned windings change neither hit nor t") {
  const TriangleMesh mesh = flat_grid(24);
  TriangleMesh other = mesh;
  for (std::uint32_t i = 0; i < mesh.size(); ++i) {
    Triangle& t = other.triangles[i];
    for (std::uint64_t k = random_bits(2, i, 0) % 3; k > 0; --k) t = {t.b, t.c, t.a};
    if (random_bits(2, i, 1) % 2) std::swap(t.a, t.c);
  }
  std::vector<Ray> rays;
  for (std::uint64_t i = 0; i < 300; ++i) {
    const Vec3f at = uniform_point(3, i, 0, {{-1, -1, 0}, {1, 1, 0}});
    rays.push_back(i % 2 ? Ray{at + Vec3f{0, 0, 2}, 0, {0, 0, -1}, kInfinity} : through({0.3f, -0.4f, 2}, at));
  }
  compare(mesh, rays, other, rays, [&](const std::vector<Hit>& a, const std::vector<Hit>& b) {
    for (std::size_t i = 0; i < a.size(); ++i) {
      INFO("ray " << i);
      REQUIRE(a[i].primitive == b[i].primitive);
      // Three products are added in another order: the last bits of t may differ where it is not exact.
      REQUIRE(std::abs(a[i].t - b[i].t) <= 4 * 0x1p-23f * a[i].t);
      if (i % 2) REQUIRE(a[i].t == 2.0f);
    }
  });
}

TEST_CASE("B29: moved by exact offsets the hits are the same, scaled by powers of two t scales exactly") {
  // Coordinates are multiples of 2^-8 below 2, so that sums with the offset are exact.
  TriangleMesh mesh = random_triangles(600, 0.2f, 3);
  const auto snap = [](Vec3f v) {
    return Vec3f{std::round(v.x * 256) / 256, std::round(v.y * 256) / 256, std::round(v.z * 256) / 256};
  };
  for (Vec3f& v : mesh.vertices) v = snap(v);
  std::vector<Ray> rays;
  for (std::uint64_t i = 0; i < 300; ++i) {
    Ray ray = through(snap(uniform_point(4, i, 0, {{-2, -2, -2}, {2, 2, 2}})),
                      snap(uniform_point(4, i, 3, {{-1, -1, -1}, {1, 1, 1}})));
    if (i % 5 == 0) ray.tfar = 0.75f;
    rays.push_back(ray);
  }
  const Vec3f offset{512, -1024, 256};
  std::vector<Ray> moved_rays = rays;
  for (Ray& ray : moved_rays) ray.origin = ray.origin + offset;
  compare(mesh, rays, moved(mesh, 1.0f, offset), moved_rays,
          [](const std::vector<Hit>& a, const std::vector<Hit>& b) { REQUIRE(same_bits(a, b)); });
  for (const int k : {-24, -3, 5, 24}) {
    INFO("scaled by 2^" << k);
    const float s = std::ldexp(1.0f, k);
    std::vector<Ray> scaled = rays;
    for (Ray& ray : scaled) ray.origin = ray.origin * s, ray.tfar = ray.tfar * s;
    compare(mesh, rays, moved(mesh, s), scaled, [&](const std::vector<Hit>& a, const std::vector<Hit>& b) {
      for (std::size_t i = 0; i < a.size(); ++i) {
        INFO("ray " << i);
        const Hit expected{a[i].t * s, a[i].u, a[i].v, a[i].primitive};
        REQUIRE(same_bits(std::span(&expected, 1), std::span(&b[i], 1)));
      }
    });
  }
}

TEST_CASE("B30: triangles in another order: the same t, and of equal ones the lowest id") {
  TriangleMesh mesh = random_triangles(500, 0.2f, 3);
  // Twins
  for (const Triangle& t : std::vector<Triangle>(mesh.triangles.begin(), mesh.triangles.begin() + 200))
    mesh.triangles.push_back(t);
  TriangleMesh other = mesh;
  const std::vector<std::uint32_t> order = shuffled(std::uint32_t(mesh.size()), 9);
  for (std::uint32_t i = 0; i < order.size(); ++i) other.triangles[i] = mesh.triangles[order[i]];
  const std::vector<Ray> rays = generic_rays(mesh, 400, 6);
  compare(mesh, rays, other, rays, [&](const std::vector<Hit>& a, const std::vector<Hit>& b) {
    std::size_t twins = 0;
    for (std::size_t i = 0; i < a.size(); ++i) {
      INFO("ray " << i);
      REQUIRE(a[i].t == b[i].t);
      REQUIRE(a[i].is_hit() == b[i].is_hit());
      if (!a[i].is_hit()) continue;
      const Triangle& t = mesh.triangles[a[i].primitive];
      REQUIRE(t == other.triangles[b[i].primitive]);
      for (const auto& [m, hit] : {std::pair{&mesh, a[i]}, std::pair{&other, b[i]}}) {
        const auto lowest = std::ranges::find(m->triangles, t) - m->triangles.begin();
        REQUIRE(std::ptrdiff_t(hit.primitive) == lowest);
        twins += std::ranges::count(m->triangles, t) > 1;
      }
    }
    CHECK(twins > 20);
  });
  for_each_combination(other, rays);
}
