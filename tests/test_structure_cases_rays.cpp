// Structure-level cases B17 and B19 to B27: invalid rays, rays in company, and rays that meshes leak to.
#include <cmath>

#include "tests/structure_cases.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

bool crack_free(const KernelRow& row) { return row.intersector == "watertight" && row.box == "padded"; }

/// Hits of the crack-free rows, for every combination.
template <class F>
void for_each_crack_free(const TriangleMesh& mesh, std::span<const Ray> rays, F&& f) {
  for (const Combination& combination : combinations()) {
    const auto accel = combination.build(mesh);
    for (const KernelRow* row : combination.rows) {
      if (!crack_free(*row)) continue;
      INFO(name_of(*row) << ", " << combination.builder);
      f(combination, *row, *accel, closest_hit(*row, *accel, rays));
    }
  }
}

/// Two poles and a rim of n vertices between them: closed.
TriangleMesh bipyramid(std::uint32_t n) {
  TriangleMesh mesh;
  mesh.vertices = {{0, 0, 1}, {0, 0, -1}};
  for (std::uint32_t i = 0; i < n; ++i) {
    const double a = 2 * 3.14159265358979323846 * i / n;
    mesh.vertices.push_back({float(std::cos(a)), float(std::sin(a)), 0});
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t a = 2 + i, b = 2 + (i + 1) % n;
    mesh.triangles.push_back({0, a, b}), mesh.triangles.push_back({1, b, a});
  }
  return mesh;
}

/// An open cylinder about the z axis, with rings of vertices at z = -1, 0 and 1.
void add_cylinder(TriangleMesh& mesh, float radius, std::uint32_t n) {
  const auto first = std::uint32_t(mesh.vertices.size());
  for (std::uint32_t i = 0; i < n; ++i) {
    const double a = 2 * 3.14159265358979323846 * i / n;
    for (const float z : {-1.0f, 0.0f, 1.0f})
      mesh.vertices.push_back({radius * float(std::cos(a)), radius * float(std::sin(a)), z});
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    for (std::uint32_t row = 0; row < 2; ++row) {
      const std::uint32_t a = first + 3 * i + row, b = first + 3 * ((i + 1) % n) + row;
      mesh.triangles.push_back({a, b, b + 1}), mesh.triangles.push_back({a, b + 1, a + 1});
    }
  }
}

}  // namespace

TEST_CASE("B17: inside a sphere far from the origin no ray gets out") {
  const Vec3f center{148376, 1234, -223423};
  const TriangleMesh mesh = moved(sphere(20), 2.0f, center);
  std::vector<Ray> rays = aimed_rays(mesh, center, 400, 3);
  for (std::uint64_t i = 0; i < 600; ++i)
    rays.push_back({center, 0, uniform_point(4, i, 0, {{-1, -1, -1}, {1, 1, 1}}), kInfinity});
  for_each_crack_free(mesh, rays,
                      [&](const Combination&, const KernelRow&, const Accel&, const std::vector<Hit>& hits) {
                        CHECK(std::ranges::all_of(hits, &Hit::is_hit));
                      });
  for_each_combination(mesh, rays);
}

TEST_CASE("B19: rays of NaN and infinity miss, and visit no more than others do") {
  const TriangleMesh mesh = random_triangles(3000, 0.1f, 2);
  const std::vector<Ray> valid = generic_rays(mesh, 320, 5);
  std::vector<Ray> invalid;
  for (int i = 0; i < 20; ++i)
    for (const Ray& ray : invalid_rays()) invalid.push_back(ray);
  REQUIRE(invalid.size() == valid.size());
  for (const Combination& combination : combinations()) {
    const auto accel = combination.build(mesh);
    for (const KernelRow* row : combination.rows) {
      INFO(name_of(*row) << ", " << combination.builder);
      if (!row->counts()) continue;
      Counters usual, odd, usual_any, odd_any;
      (void)closest_hit(*row, *accel, valid, &usual), (void)any_hit(*row, *accel, valid, &usual_any);
      for (const Hit& hit : closest_hit(*row, *accel, invalid, &odd)) REQUIRE_FALSE(hit.is_hit());
      for (const std::uint8_t any : any_hit(*row, *accel, invalid, &odd_any)) REQUIRE(any == 0);
      CHECK(double(odd.nodes + odd.blocks) <= 2.5 * double(usual.nodes + usual.blocks));
      CHECK(double(odd_any.nodes + odd_any.blocks) <= 2.5 * double(usual_any.nodes + usual_any.blocks));
    }
  }
}

TEST_CASE("B20: inactive rays among others change nothing and are answered with a miss") {
  const TriangleMesh mesh = random_triangles(2000, 0.1f, 2);
  std::vector<Ray> rays = generic_rays(mesh, 257, 5);
  for (const Ray& ray : aimed_rays(mesh, {0.1f, 0.2f, 3}, 257, 6)) rays.push_back(ray);
  for (const Combination& combination : combinations()) {
    const auto accel = combination.build(mesh);
    for (const KernelRow* row : combination.rows) {
      INFO(name_of(*row) << ", " << combination.builder);
      const std::vector<Hit> alone = closest_hit(*row, *accel, rays);
      for (const unsigned of_eight : {1u, 4u, 7u}) {
        std::vector<Ray> mixed = rays;
        std::vector<Hit> expected = alone;
        for (std::size_t i = 0; i < rays.size(); ++i) {
          if (random_bits(3, i, of_eight) % 8 >= of_eight) continue;
          const float infinity = kInfinity, nan = std::numeric_limits<float>::quiet_NaN();
          if (i % 3 == 0) mixed[i].tnear = infinity, mixed[i].tfar = -infinity;
          if (i % 3 == 1) mixed[i].tnear = 2, mixed[i].tfar = 1;
          if (i % 3 == 2) mixed[i] = {{nan, nan, nan}, nan, {nan, nan, nan}, nan};
          expected[i] = Hit{};
        }
        REQUIRE(same_bits(closest_hit(*row, *accel, mixed), expected));
        const std::vector<std::uint8_t> any = any_hit(*row, *accel, mixed);
        for (std::size_t i = 0; i < any.size(); ++i) REQUIRE(any[i] == std::uint8_t(expected[i].is_hit()));
      }
    }
  }
}

TEST_CASE("B21: eight rays to eight octants answer together as each does alone, on every traversal") {
  const TriangleMesh mesh = random_triangles(2000, 0.15f, 2);
  std::vector<Ray> rays;
  for (std::uint64_t i = 0; i < 64; ++i) {
    for (unsigned octant = 0; octant < 8; ++octant) {
      const Vec3f d = uniform_point(8, i, 4 * octant, {{0.05f, 0.05f, 0.05f}, {1, 1, 1}});
      rays.push_back(
          {{0, 0, 0}, 0, {octant & 1 ? d.x : -d.x, octant & 2 ? d.y : -d.y, octant & 4 ? d.z : -d.z}, kInfinity});
    }
  }
  for (const Combination& combination : combinations()) {
    const auto accel = combination.build(mesh);
    for (const KernelRow* row : combination.rows) {
      INFO(name_of(*row) << ", " << combination.builder);
      const std::vector<Hit> together = closest_hit(*row, *accel, rays);
      for (std::size_t i = 0; i < rays.size(); ++i) {
        INFO("ray " << i);
        REQUIRE(same_bits(closest_hit(*row, *accel, std::span(rays).subspan(i, 1)), std::span(together).subspan(i, 1)));
      }
    }
  }
}

TEST_CASE("B22: with 0 to 64 active rays of 64, every traversal gives the single rays' answers") {
  // Hybrid and packet kernels switch by the number of active rays: each number is met here.
  const TriangleMesh mesh = random_triangles(2000, 0.15f, 2);
  const std::vector<Ray> coherent = aimed_rays(mesh, {0.1f, 0.2f, 3}, 64, 6), mixed = generic_rays(mesh, 64, 7);
  for (const Combination& combination : combinations()) {
    const auto accel = combination.build(mesh);
    for (const KernelRow* row : combination.rows) {
      if (row->box != "padded") continue;
      const KernelRow* single = find_kernel(row->structure, row->leaf, row->intersector, row->box, "single", row->isa);
      INFO(name_of(*row) << ", " << combination.builder);
      if (!single) continue;
      for (const std::vector<Ray>& all : {coherent, mixed}) {
        for (std::size_t active = 0; active <= 64; active += row == single ? 16 : 1) {
          std::vector<Ray> rays = all;
          for (std::size_t i = 0; i < 64; ++i)  // which ones: those with the smallest random numbers
            if (mix64(i) % 64 >= active) rays[i].tnear = kInfinity, rays[i].tfar = -kInfinity;
          REQUIRE(same_bits(closest_hit(*row, *accel, rays), closest_hit(*single, *accel, rays)));
          REQUIRE(any_hit(*row, *accel, rays) == any_hit(*single, *accel, rays));
        }
      }
    }
  }
}

TEST_CASE("B23: poles where thousands of triangles meet: rays to vertices do not get out") {
  const Vec3f inside{0.03f, -0.02f, 0.11f};
  const auto rays_of = [&](const TriangleMesh& mesh, std::uint32_t n) {
    std::vector<Ray> rays{through(inside, {0, 0, 1}),
                          through(inside, {0, 0, -1}),
                          {{0, 0, 0}, 0, {0, 0, 1}, kInfinity},
                          {{0, 0, 0}, 0, {-0.0f, 0, -1}, kInfinity}};
    for (const Ray& ray : aimed_rays(mesh, inside, 120, n)) rays.push_back(ray);
    return rays;
  };
  for (const std::uint32_t n : {64u, 2048u}) {
    INFO(n << " triangles a pole");
    const TriangleMesh mesh = bipyramid(n);
    const std::vector<Ray> rays = rays_of(mesh, n);
    for_each_combination(mesh, rays,
                         [&](const Combination& combination, const Accel& accel, const StructureStatistics&) {
                           for (const KernelRow* row : combination.rows)
                             if (crack_free(*row))
                               CHECK(std::ranges::all_of(closest_hit(*row, accel, rays), &Hit::is_hit));
                         });
  }
  // Far more of them, without the oracle, which would look at each exactly, and with the builders that do not clip each
  // to every cell.
  const TriangleMesh mesh = bipyramid(65536);
  const std::vector<Ray> rays = rays_of(mesh, 65536);
  for (const Combination& combination : combinations()) {
    if (combination.builder != "binned_sah" || combination.is("kdtree")) continue;
    const auto accel = combination.build(mesh);
    for (const KernelRow* row : combination.rows) {
      INFO(name_of(*row));
      if (crack_free(*row)) CHECK(std::ranges::all_of(closest_hit(*row, *accel, rays), &Hit::is_hit));
    }
  }
}

TEST_CASE("B24: through vertices of nested cylinders: an eleventh one outside changes no answer") {
  TriangleMesh ten;
  for (int i = 1; i <= 10; ++i) add_cylinder(ten, float(i), 24);
  TriangleMesh eleven = ten;
  add_cylinder(eleven, 11, 24);
  std::vector<Ray> rays;
  for (std::uint32_t i = 0; i < 240; ++i) rays.push_back(through({0, 0, 0.1f}, ten.vertices[3 * i + 1]));
  for (const Combination& combination : combinations()) {
    const auto a = combination.build(ten), b = combination.build(eleven);
    for (const KernelRow* row : combination.rows) {
      if (row->box != "padded") continue;
      INFO(name_of(*row) << ", " << combination.builder);
      // From cylinder to cylinder, each hit's t the next one's tnear.
      const auto same_way = [&](std::size_t i) {
        Ray ray = rays[i];
        for (int step = 0; step < 12; ++step) {
          const Hit hit = closest_hit(*row, *a, std::span(&ray, 1))[0];
          const Hit with = closest_hit(*row, *b, std::span(&ray, 1))[0];
          if (hit.is_hit() && !same_bits(std::span(&hit, 1), std::span(&with, 1))) return false;
          if (!hit.is_hit() && with.is_hit() && with.primitive < ten.size()) return false;
          if (!hit.is_hit()) return step > 0 || !crack_free(*row);
          ray.tnear = std::nextafter(hit.t, kInfinity);
        }
        return true;
      };
      require_each(rays.size(), same_way, [](std::size_t) { return "the eleventh changes it"; });
    }
  }
}

TEST_CASE("B25: a surface on integer coordinates under a grid of rays along -y has no gaps") {
  constexpr std::uint32_t n = 48;
  TriangleMesh mesh;
  for (std::uint32_t z = 0; z <= n; ++z)
    for (std::uint32_t x = 0; x <= n; ++x)
      mesh.vertices.push_back(
          {float(x), std::floor(9.0f * std::sin(0.31f * float(x)) * std::cos(0.23f * float(z))), float(z)});
  for (std::uint32_t z = 0; z < n; ++z) {
    for (std::uint32_t x = 0; x < n; ++x) {
      const std::uint32_t a = z * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
      mesh.triangles.push_back({a, b, d}), mesh.triangles.push_back({a, d, c});
    }
  }
  std::vector<Ray> rays;
  for (std::uint32_t i = 0; i <= 2 * n; i += 3)
    for (std::uint32_t j = 0; j <= 2 * n; j += 2)
      rays.push_back(
          {{0.5f * float(i), 100, 0.5f * float(j)}, 0, {i % 2 ? 0.0f : -0.0f, -1, j % 4 ? 0.0f : -0.0f}, kInfinity});
  for_each_combination(mesh, rays, [&](const Combination& combination, const Accel& accel, const StructureStatistics&) {
    for (const KernelRow* row : combination.rows)
      if (crack_free(*row)) CHECK(std::ranges::all_of(closest_hit(*row, accel, rays), &Hit::is_hit));
  });
}

TEST_CASE("B26: a light above a floor is seen at every scale, and hidden by what stands between") {
  for (int k = 0; k <= 7; ++k) {
    const float s = std::pow(10.0f, float(k));
    INFO("scale " << s);
    TriangleMesh mesh;
    mesh.vertices = {{-4 * s, -4 * s, 0}, {4 * s, -4 * s, 0}, {4 * s, 4 * s, 0}, {-4 * s, 4 * s, 0}};
    mesh.triangles = {{0, 1, 2}, {0, 2, 3}};
    const auto disk = [&](Vec3f center, float radius) {
      const auto first = std::uint32_t(mesh.vertices.size());
      mesh.vertices.push_back(center);
      for (int i = 0; i < 32; ++i) {
        const double a = 2 * 3.14159265358979323846 * i / 32;
        mesh.vertices.push_back(center + Vec3f{radius * float(std::cos(a)), radius * float(std::sin(a)), 0});
      }
      for (std::uint32_t i = 0; i < 32; ++i) mesh.triangles.push_back({first, first + 1 + i, first + 1 + (i + 1) % 32});
    };
    const std::size_t light = mesh.size();
    disk({0, 0, 4 * s}, s);
    disk({2 * s, 0, 2 * s}, 0.5f * s);
    std::vector<Ray> seen, hidden;
    for (std::uint64_t i = 0; i < 40; ++i) {
      const Vec3f from{uniform(3, i, 0, -3 * s, 0.5f * s), uniform(3, i, 1, -3 * s, 3 * s), 0};
      const Vec3f to{uniform(3, i, 2, -0.5f * s, 0.5f * s), uniform(3, i, 3, -0.5f * s, 0.5f * s), 4 * s};
      seen.push_back({from, 1e-4f, to - from, kInfinity});
      const Vec3f middle{2 * s + uniform(3, i, 4, -0.2f * s, 0.2f * s), uniform(3, i, 5, -0.2f * s, 0.2f * s), 2 * s};
      hidden.push_back({middle * 2.0f - to, 1e-4f, (to - middle) * 2.0f, 0.999f});
    }
    std::vector<Ray> all = seen;
    all.insert(all.end(), hidden.begin(), hidden.end());
    for_each_combination(mesh, all,
                         [&](const Combination& combination, const Accel& accel, const StructureStatistics&) {
                           for (const KernelRow* row : combination.rows) {
                             if (!crack_free(*row)) continue;
                             INFO(name_of(*row));
                             for (const Hit& hit : closest_hit(*row, accel, seen))
                               CHECK((hit.primitive >= light && hit.primitive < light + 32));
                             std::vector<Ray> shadow = seen;
                             for (Ray& ray : shadow) ray.tfar = 0.999f;
                             for (const std::uint8_t any : any_hit(*row, accel, shadow)) CHECK(any == 0);
                             for (const std::uint8_t any : any_hit(*row, accel, hidden)) CHECK(any == 1);
                           }
                         });
  }
}

TEST_CASE(
    "B27: rays that start 10^-k above a triangle: self-hits are those of the exact origin, whatever the structure") {
  std::size_t below = 0, rays_in_all = 0;
  for (int scale = 0; scale <= 5; ++scale) {
    const float s = std::pow(10.0f, float(scale));
    const TriangleMesh mesh = moved(random_triangles(40, 0.5f, 21), s);
    std::vector<Ray> rays;
    for (std::uint32_t i = 0; i < mesh.size(); ++i) {
      const auto c = mesh.corners(i);
      const Vec3f normal = normalize(cross(c[1] - c[0], c[2] - c[0]));
      for (int k = 0; k <= 9; ++k) {
        const Vec3f from = (c[0] + c[1] + c[2]) * (1.0f / 3) + normal * std::pow(10.0f, float(-k));
        Vec3f d = normal + uniform_point(3, i, std::uint64_t(3 * k), {{-1, -1, -1}, {1, 1, 1}});
        rays.push_back({from, 0, d, kInfinity});
      }
    }
    Reference reference(mesh, rays);
    for (std::size_t i = 0; i < rays.size(); ++i) below += reference.truth()[i].hit.primitive == i / 10;
    rays_in_all += rays.size();
    for_each_combination(mesh, rays);
  }
  std::cout << "B27: of " << rays_in_all << " rays " << below << " meet the triangle that they were started from\n";
  CHECK(below > 0);
}
