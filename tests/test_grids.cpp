// grid, octree and bih: the brute force's answers bit for bit on rays that lie in cell faces, pass through
// corners and come from far away; bounded memory on scenes made to break it; the same structure for any
// number of threads.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <set>
#include <vector>

#include "core/error.h"
#include "core/random.h"
#include "oracle/hard_rays.h"
#include "oracle/oracle.h"
#include "structures/accel.h"
#include "structures/end_point_overlap.h"
#include "structures/grid/cell_counts.h"
#include "structures/grid/grid_builder.h"
#include "structures/leaves/triangle_overlap.h"
#include "structures/octree/octree.h"
#include "structures/statistics.h"
#include "tests/catch.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"
#include "traversal/kernel_table.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

struct Variant {
  const char *structure, *builder;
};
const Variant kVariants[] = {{"grid", "two_level"}, {"grid", "uniform"}, {"octree", "octants"}, {"bih", "binned_sah"}};

std::unique_ptr<Accel> build(const Variant& v, const TriangleMesh& mesh, std::string leaf = "triangle4",
                             unsigned threads = 1, const BuilderParameters& parameters = {},
                             BuildReport* report = nullptr) {
  BuildSettings settings;
  settings.builder = v.builder, settings.leaf = std::move(leaf), settings.threads = threads,
  settings.parameters = parameters;
  BuildReport own;
  return build_structure(v.structure, mesh, settings, report ? *report : own);
}

void add_triangle(TriangleMesh& mesh, Vec3f a, Vec3f b, Vec3f c) {
  const auto first = std::uint32_t(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), {a, b, c});
  mesh.triangles.push_back({first, first + 1, first + 2});
}

/// Unit triangles around the origin, and one vertex far away.
TriangleMesh with_outlier(std::size_t count) {
  TriangleMesh mesh = random_triangles(count, 1.0f, 11);
  add_triangle(mesh, {1e12f, 0, 0}, {0, 1, 0}, {0, 0, 1});
  return mesh;
}

TriangleMesh equal_points(std::size_t count) {
  TriangleMesh mesh;
  mesh.vertices.push_back({1, 2, 3});
  mesh.triangles.assign(count, Triangle{0, 0, 0});
  add_triangle(mesh, {0, 0, 0}, {2, 0, 0}, {0, 2, 0});
  return mesh;
}

/// Slivers along the diagonal, each beside the other.
TriangleMesh slivers(std::size_t count) {
  TriangleMesh mesh;
  for (std::size_t i = 0; i < count; ++i) {
    const float d = float(i) * 0x1p-20f;
    add_triangle(mesh, {d, 0, 0}, {1 + d, 1, 1}, {1 + d + 0x1p-20f, 1, 1});
  }
  return mesh;
}

/// Large triangles through the origin: every plane cuts all of them.
TriangleMesh star(std::size_t count) {
  TriangleMesh mesh;
  const Bounds3f cube{{-1, -1, -1}, {1, 1, 1}};
  for (std::size_t i = 0; i < count; ++i)
    add_triangle(mesh, uniform_point(3, i, 0, cube), uniform_point(3, i, 3, cube),
                 uniform_point(3, i, 6, cube) * -1.0f);
  return mesh;
}

/// Quads whose edges fall on the faces of cells of any power of two, on the planes z = 0 .. 7 of a box of 8.
TriangleMesh on_cell_faces() {
  TriangleMesh mesh;
  for (int z = 0; z <= 8; ++z)
    for (int y = 0; y < 8; ++y)
      for (int x = 0; x < 8; ++x) {
        const Vec3f p{float(x), float(y), float(z)};
        add_triangle(mesh, p, p + Vec3f{1, 0, 0}, p + Vec3f{1, 1, 0});
        if ((x + y + z) % 3 == 0) add_triangle(mesh, p, p + Vec3f{0, 1, 0}, p + Vec3f{0, 1, 1});
      }
  return mesh;
}

/// Through vertices and edge midpoints: along each axis both ways, with 0, -0 and tiny other components, from
/// near, far and inside, with short and long directions, ending and starting half-way; and askew.
std::vector<Ray> hard_rays(const TriangleMesh& mesh, std::size_t count, std::uint64_t seed) {
  const Vec3f e = mesh.bounds().extent();
  const float size = std::max({e.x, e.y, e.z, 1e-6f});
  const float aways[] = {3, 30, 1000, 0};
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < count; ++i) {
    const auto c = mesh.corners(random_bits(seed, i, 0) % mesh.size());
    const Vec3f at = i % 2 ? c[i % 3] : (c[0] + c[1]) * 0.5f;
    for (std::size_t a = 0; a < 3; ++a) {
      for (const float sign : {-1.0f, 1.0f}) {
        Ray r{at, 0, i % 4 < 2 ? Vec3f{0, 0, 0} : Vec3f{-0.0f, -0.0f, -0.0f}, kInfinity};
        r.origin[a] -= sign * size * aways[i % 4];
        r.direction[a] = sign * (i % 7 == 0 ? 1e-3f : size);
        if (i % 11 == 0) r.direction[(a + 1) % 3] = r.direction[a] * 1e-30f;
        if (i % 5 == 0) r.tfar = 3.25f;
        if (i % 5 == 1) r.tnear = 3.25f;
        rays.push_back(r);
      }
    }
    const Vec3f d{uniform(seed, i, 1, -1, 1), uniform(seed, i, 2, -1, 1), uniform(seed, i, 3, -1, 1)};
    for (const float away : {0.0f, 0.5f, 10.0f, 100.0f, 1e4f})
      rays.push_back({at - d * (size * away), 0, d, kInfinity});
    for (const float scale : {1e-20f, 1e-8f, 1e8f, 1e20f}) rays.push_back({at - d * size, 0, d * scale, kInfinity});
  }
  return rays;
}

/// References and what the visitor is shown, as a hash.
class Recorder final : public StructureVisitor {
 public:
  void node(const NodeView& n) override { put(n.depth), put(n.bounds), put(n.child_bounds.size()); }
  void leaf(const LeafView& l) override {
    put(l.depth), put(l.bounds), put(l.blocks);
    for (std::uint32_t p : l.primitives) put(p), seen.insert(p);
    references += l.primitives.size();
  }
  std::uint64_t hash = 1;
  std::size_t references = 0;
  std::set<std::uint32_t> seen;
  bool finite = true;  ///< all boxes

 private:
  void put(std::uint64_t x) { hash = mix64(hash ^ x); }
  void put(const Bounds3f& b) {
    finite &= is_finite(b.lower) && is_finite(b.upper);
    for (std::size_t a = 0; a < 3; ++a)
      put(std::bit_cast<std::uint32_t>(b.lower[a])), put(std::bit_cast<std::uint32_t>(b.upper[a]));
  }
};

}  // namespace

TEST_CASE(
    "padded answers are the brute force's, bit for bit, on rays in cell faces, through corners and from far "
    "away") {
  std::vector<KernelScene> scenes{{"cell faces", on_cell_faces()},
                                  {"cell faces, far", moved(on_cell_faces(), 1.0f, {1e4f, -1e4f, 1e4f})},
                                  {"flat", flat_grid(32)},
                                  {"sphere, 1e4", moved(sphere(12), 1.0f, {-1e4f, 1e4f, 1e4f})},
                                  {"random", random_triangles(2000, 0.1f, 9)},
                                  {"large and small", random_triangles(300, 1.0f, 10)},
                                  {"outlier", with_outlier(500)},
                                  {"equal points", equal_points(500)},
                                  {"slivers", slivers(300)}};
  for (const KernelScene& scene : scenes) {
    const std::vector<Ray> rays = hard_rays(scene.mesh, 60, 5);
    for (const KernelRow& row : runnable_rows()) {
      if (row.box != "padded" || row.intersector != "watertight" || row.traversal != "single") continue;
      const KernelRow* reference = find_kernel("brute_force", row.leaf, row.intersector, row.box, "single", row.isa);
      for (const Variant& v : kVariants) {
        if (row.structure != v.structure || !reference) continue;
        INFO(scene.name << ": " << name_of(row) << ", " << v.builder);
        const auto truth = build({"brute_force", "in_order"}, scene.mesh, std::string(row.leaf)),
                   accel = build(v, scene.mesh, std::string(row.leaf));
        const std::vector<Hit> want = closest_hit(*reference, *truth, rays), got = closest_hit(row, *accel, rays);
        const std::vector<std::uint8_t> occluded = any_hit(row, *accel, rays);
        for (std::size_t i = 0; i < rays.size(); ++i) {
          INFO("ray " << i << ": t " << got[i].t << ", primitive " << got[i].primitive << "; brute force: t "
                      << want[i].t << ", primitive " << want[i].primitive);
          REQUIRE(same_bits(std::span(got).subspan(i, 1), std::span(want).subspan(i, 1)));
          REQUIRE(occluded[i] == std::uint8_t(want[i].is_hit()));
        }
      }
    }
  }
}

TEST_CASE("memory is bounded whatever the scene, and every triangle stands in a leaf") {
  const KernelScene scenes[] = {{"outlier", with_outlier(100000)},
                                {"equal points", equal_points(1000000)},
                                {"slivers", slivers(20000)},
                                {"star", star(20000)}};
  for (const KernelScene& scene : scenes) {
    const std::size_t n = scene.mesh.size();
    for (const Variant& v : kVariants) {
      INFO(scene.name << ": " << v.structure << ", " << v.builder);
      BuildReport report;
      const auto accel = build(v, scene.mesh, "triangle4i", 2, {}, &report);
      Recorder seen;
      REQUIRE(accel->visit(seen));
      CHECK(seen.seen.size() == n);
      const std::size_t most = v.structure == std::string("octree") ? octree::kMostReferences
                               : v.structure == std::string("grid") ? grid::kMostReferences
                                                                    : 1;
      CHECK(seen.references <= most * n);
      CHECK(accel->bytes() <= most * n * 64 + (1u << 16));
      CHECK(report.peak_bytes < 4 * most * n * 64 + (1u << 20));
    }
  }
}

TEST_CASE("scenes as wide as floats go take no more cells than others, and lose no hit") {
  constexpr float kMost = std::numeric_limits<float>::max();
  TriangleMesh one;
  add_triangle(one, {-kMost, -kMost, kMost / 2}, {kMost, -kMost, kMost / 2}, {0, kMost, kMost / 2});
  TriangleMesh many = random_triangles(300, 0.3f, 21);
  for (Vec3f& p : many.vertices)
    for (std::size_t a = 0; a < 3; ++a) p[a] = std::clamp(float(double(p[a]) * 2 * kMost), -kMost, kMost);
  // Of eight cells, the fewest that such a scene has, it touches seven.
  TriangleMesh seven_cells;
  add_triangle(seven_cells, {3e38f, -1.5e38f, -1.5e38f}, {-1.5e38f, 3e38f, -1.5e38f}, {-1.5e38f, -1.5e38f, 3e38f});
  for (const TriangleMesh& mesh : {one, many, seven_cells}) {
    std::vector<Ray> rays;
    for (std::uint64_t i = 0; i < 200; ++i) {
      const auto c = mesh.corners(i % mesh.size());
      const Vec3f at = c[0] * 0.25f + c[1] * 0.25f + c[2] * 0.5f;
      const Vec3f from = i % 2 ? Vec3f{} : uniform_point(5, i, 0, {{-1, -1, -1}, {1, 1, 1}}) * (kMost / 4);
      rays.push_back({from, 0, at * 0.25f - from * 0.25f, kInfinity});
    }
    const Oracle oracle(mesh);
    const std::vector<ExactHit> truth = oracle.closest_hit(rays);
    CHECK(std::ranges::any_of(truth, [](const ExactHit& h) { return h.hit.is_hit(); }));
    for (const char* builder : {"two_level", "uniform"}) {
      const auto accel = build({"grid", builder}, mesh, "triangle4i");
      CHECK(accel->bytes() < grid::kMostReferences * mesh.size() * 64 + (1u << 16));
      for (const KernelRow& row : kernel_table()) {
        if (row.structure != "grid" || row.leaf != "triangle4i" || !is_available(row.isa)) continue;
        INFO(builder << ", " << name_of(row));
        const std::vector<Hit> hits = closest_hit(row, *accel, rays);
        if (row.intersector != "exact" || row.box != "padded") continue;
        for (std::size_t i = 0; i < rays.size(); ++i) {
          INFO("ray " << i);
          CHECK(hits[i].primitive == truth[i].hit.primitive);
          CHECK((!truth[i].hit.is_hit() || hits[i].t == truth[i].hit.t));
        }
      }
    }
  }
}

/// Grids of `mesh`, single rays and packets, answer with `exact` what is true, closest hits and any.
void check_exact(const TriangleMesh& mesh, std::span<const Ray> rays, std::span<const ExactHit> truth) {
  for (const Isa isa : available_isas()) {
    const std::string leaf(default_leaf("grid", "exact", isa));
    for (const char* builder : {"two_level", "uniform"}) {
      const auto accel = build({"grid", builder}, mesh, leaf);
      for (const char* traversal : {"single", "packet8", "packet16", "packet64", "hybrid16", "auto"}) {
        const KernelRow* row = find_kernel("grid", leaf, "exact", "padded", traversal, isa);
        if (isa == Isa::scalar && !row) continue;
        REQUIRE(row);
        INFO(builder << ", " << name_of(*row));
        const std::vector<Hit> hits = closest_hit(*row, *accel, rays);
        const std::vector<std::uint8_t> occluded = any_hit(*row, *accel, rays);
        std::size_t wrong = 0, lost = 0;
        for (std::size_t i = 0; i < rays.size(); ++i)
          wrong += hits[i].primitive != truth[i].hit.primitive, lost += occluded[i] == 0 && truth[i].hit.is_hit();
        CHECK(wrong == 0);
        CHECK(lost == 0);
      }
    }
  }
}

TEST_CASE("a ray that has met an inner grid's last face stays in its last cells until it leaves the outer cell") {
  // Far from the origin the two faces are rounded apart, and rays that hardly move across them are between them for
  // long.
  const TriangleMesh mesh = moved_and_scaled(sphere(42), 1e5, 0);
  const Bounds3f box = mesh.bounds();
  std::vector<Ray> rays;
  for (std::uint64_t i = 0; i < 30000; ++i) {
    Ray ray;
    for (std::size_t a = 0; a < 3; ++a) {
      const double low = box.lower[a], high = box.upper[a];
      ray.origin[a] = float(low + (high - low) * (0.05 + 0.9 * random_double(61, i, unsigned(a))));
      ray.direction[a] = float(2 * random_double(62, i, unsigned(a)) - 1);
    }
    ray.direction[i % 3] *= std::ldexp(1.0f, -int(i / 3 % 24));
    rays.push_back(ray);
  }
  const std::vector<ExactHit> truth = Oracle(mesh).closest_hit(rays);
  CHECK(std::ranges::count_if(truth, [](const ExactHit& h) { return h.hit.is_hit(); }) > 15000);
  check_exact(mesh, rays, truth);
}

TEST_CASE("rays so short that reciprocals of their components overflow lose no hit in a grid") {
  const TriangleMesh mesh = moved_and_scaled(random_triangles(300, 0.4f, 33), 0, -17);
  const Vec3f e = mesh.bounds().extent();
  const float size = std::max({e.x, e.y, e.z});
  std::vector<Ray> rays;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const auto c = mesh.corners(random_bits(71, i, 0) % mesh.size());
    Ray ray{c[0] * 0.5f + c[1] * 0.3f + c[2] * 0.2f, 0, {}, kInfinity};
    for (std::size_t a = 0; a < 3; ++a)
      ray.direction[a] =
          std::ldexp(uniform(72, i, unsigned(a), -1, 1), -126 - int(random_bits(73, i, unsigned(a)) % 6));
    ray.direction[i % 3] = i % 2 ? 0x1p-70f : -0x1p-70f;
    ray.origin[i % 3] -= std::copysign(2 * size, ray.direction[i % 3]);
    rays.push_back(ray);
  }
  const std::vector<ExactHit> truth = Oracle(mesh).closest_hit(rays);
  CHECK(std::ranges::count_if(truth, [](const ExactHit& h) { return h.hit.is_hit(); }) > 1900);
  check_exact(mesh, rays, truth);
}

TEST_CASE("an octree wider than floats go is divided as a narrower one is, and loses no hit") {
  const TriangleMesh small = random_triangles(3000, 0.02f, 23);
  float reach = 0;
  for (const Vec3f& v : small.vertices) reach = std::max({reach, std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)});
  const auto scaled = [&](double size) {
    TriangleMesh mesh = small;
    for (Vec3f& v : mesh.vertices)
      for (std::size_t a = 0; a < 3; ++a)
        v[a] = float(std::clamp(2.0 * double(v[a]) / double(reach) - 1.0, -1.0, 1.0) * size);
    return mesh;
  };
  constexpr double kMost = std::numeric_limits<float>::max();
  const TriangleMesh wide = scaled(kMost * 0.999), narrow = scaled(kMost * 0.25);
  REQUIRE(std::isinf(wide.bounds().upper.x - wide.bounds().lower.x));
  const auto of_wide = build(kVariants[2], wide, "triangle4i"), of_narrow = build(kVariants[2], narrow, "triangle4i");
  const StructureStatistics w = compute_statistics(*of_wide, wide, {}, false),
                            n = compute_statistics(*of_narrow, narrow, {}, false);
  CAPTURE(w.leaves, n.leaves, w.references, n.references);
  CHECK(n.leaves > 300);
  CHECK(10 * w.leaves > 8 * n.leaves);
  CHECK(10 * w.leaves < 11 * n.leaves);
  Recorder seen;
  REQUIRE(of_wide->visit(seen));
  CHECK(seen.finite);
  std::vector<Ray> rays;
  for (std::uint64_t i = 0; i < 300; ++i) {
    const auto c = wide.corners(i * 7 % wide.size());
    const Vec3f at = c[0] * 0.25f + c[1] * 0.25f + c[2] * 0.5f;
    const Vec3f from = uniform_point(5, i, 0, {{-1, -1, -1}, {1, 1, 1}}) * (float(kMost) / 4);
    rays.push_back({from, 0, at * 0.25f - from * 0.25f, kInfinity});
  }
  const std::vector<ExactHit> truth = Oracle(wide).closest_hit(rays);
  CHECK(std::ranges::count_if(truth, [](const ExactHit& h) { return h.hit.is_hit(); }) > 100);
  for (const KernelRow& row : kernel_table()) {
    if (row.structure != "octree" || row.leaf != "triangle4i" || !is_available(row.isa)) continue;
    if (row.intersector != "exact" || row.box != "padded") continue;
    INFO(name_of(row));
    const std::vector<Hit> hits = closest_hit(row, *of_wide, rays);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      INFO("ray " << i);
      CHECK(hits[i].primitive == truth[i].hit.primitive);
    }
  }
}

TEST_CASE("grid, octree and bih are the same for any number of threads") {
  const TriangleMesh mesh = random_triangles(60000, 0.03f, 12);
  for (const Variant& v : kVariants) {
    std::uint64_t expected = 0;
    for (unsigned threads : {1u, 2u, 5u}) {
      Recorder seen;
      REQUIRE(build(v, mesh, "triangle8", threads)->visit(seen));
      if (expected == 0) expected = seen.hash;
      INFO(v.structure << ", " << v.builder << ": threads " << threads);
      CHECK(seen.hash == expected);
      CHECK(seen.seen.size() == mesh.size());
    }
  }
}

TEST_CASE("leaves that hold the same triangles share their blocks") {
  TriangleMesh mesh = random_triangles(4000, 0.02f, 13);
  for (Vec3f& p : mesh.vertices) p.z *= 0.01f;
  for (int i = 0; i < 40; ++i) add_triangle(mesh, {-1, -1, float(i) + 1}, {1, -1, float(i) + 1}, {1, 1, float(i) + 1});
  BuilderParameters p;
  p.grid_density = 16;
  const auto accel = build({"grid", "uniform"}, mesh, "triangle1", 1, p);
  Recorder seen;
  REQUIRE(accel->visit(seen));
  const std::size_t cells = std::size_t(2 * p.grid_density + 8) * mesh.size();
  CHECK(seen.references > 2 * mesh.size());
  CHECK(accel->bytes() < cells * sizeof(LeafCode) + seen.references * 40 / 2);
}

TEST_CASE("the triangle/box test agrees with clipping the triangle to the box") {
  const Bounds3f space{{-1, -1, -1}, {1, 1, 1}};
  std::size_t touched = 0, apart = 0;
  for (std::uint64_t i = 0; i < 20000; ++i) {
    const std::array<Vec3f, 3> t{uniform_point(1, i, 0, space), uniform_point(1, i, 3, space),
                                 uniform_point(1, i, 6, space)};
    Bounds3f box;
    const Vec3f center = uniform_point(1, i, 9, space),
                half = uniform_point(1, i, 12, Bounds3f{{0.01f, 0.01f, 0.01f}, {0.4f, 0.4f, 0.4f}});
    box.extend(center - half), box.extend(center + half);
    Bounds3f of;
    for (const Vec3f& p : t) of.extend(p);
    bool bounds_meet = true;
    std::array<double, 3> c, h;
    for (std::size_t a = 0; a < 3; ++a) {
      bounds_meet &= of.lower[a] <= box.upper[a] && of.upper[a] >= box.lower[a];
      c[a] = 0.5 * (double(box.lower[a]) + box.upper[a]), h[a] = 0.5 * (double(box.upper[a]) - box.lower[a]);
    }
    const bool touches = bounds_meet && TriangleOverlap(t).touches(c, h);
    const bool inside = clipped_area(t, box) > 1e-12;
    INFO("triangle " << i);
    CHECK(touches == inside);
    ++(inside ? touched : apart);
  }
  CHECK(touched > 1000);
  CHECK(apart > 1000);
  // Degenerate triangles touch where they are.
  for (const Vec3f b : {Vec3f{0, 0, 0}, Vec3f{2, 2, 2}, Vec3f{2, 0, 0}}) {
    CHECK(TriangleOverlap({Vec3f{0, 0, 0}, b, b}).touches({0.1, 0.1, 0.1}, {0.2, 0.2, 0.2}));
    CHECK(TriangleOverlap({b, Vec3f{0, 0, 0}, b * 0.5f}).touches({0.1, 0.1, 0.1}, {0.2, 0.2, 0.2}));
  }
}

TEST_CASE("a needle is not lost to the rounding of its normal") {
  std::size_t all_rounding = 0;
  for (std::uint64_t i = 0; i < 20000; ++i) {
    const Vec3f tip = uniform_point(31, i, 0, {{-1, -1, -1}, {1, 1, 1}}),
                end = uniform_point(31, i, 3, {{-1, -1, -1}, {1, 1, 1}}) * std::ldexp(1.0f, -int(i % 3) * 40);
    const float width = std::ldexp(1.0f, -int(i % 80));
    std::array<Vec3f, 3> t{tip, end, end + uniform_point(31, i, 6, {{-1, -1, -1}, {1, 1, 1}}) * width};
    std::rotate(t.begin(), t.begin() + std::ptrdiff_t(i / 3 % 3), t.end());
    const double pad = 0x1p-44 * std::max({double(std::abs(tip.x)), double(std::abs(tip.y)), double(std::abs(tip.z)),
                                           double(std::abs(end.x)), double(std::abs(end.y)), double(std::abs(end.z))});
    const TriangleOverlap overlap(t);
    all_rounding += width < 0x1p-53f;
    for (int at = 0; at <= 64; ++at) {  // points of the edge that is long, in boxes of their own
      const double s = at / 64.0;
      const std::array<double, 3> p{tip.x + s * (double(end.x) - tip.x), tip.y + s * (double(end.y) - tip.y),
                                    tip.z + s * (double(end.z) - tip.z)};
      INFO("triangle " << i << ", " << at);
      if (!overlap.touches(p, {pad, pad, pad})) FAIL_CHECK("a point of the triangle is outside");
    }
  }
  CHECK(all_rounding > 5000);
}

TEST_CASE("a grid's expected steps are what random rays take") {
  const TriangleMesh mesh = random_triangles(20000, 1e-4f, 14);
  const std::span<const KernelRow> rows = kernel_table();
  const auto row = std::ranges::find_if(
      rows, [](const KernelRow& r) { return r.structure == "grid" && r.leaf == "triangle4" && is_available(r.isa); });
  REQUIRE(row != rows.end());
  const auto accel = build({"grid", "uniform"}, mesh);
  struct Steps final : StructureVisitor {
    double steps = 0;
    void node(const NodeView& n) override { steps = n.steps; }
    void leaf(const LeafView&) override {}
  } seen;
  REQUIRE(accel->visit(seen));
  std::vector<Ray> rays;
  for (std::uint64_t i = 0; rays.size() < 20000;
       ++i) {  // isotropic lines: a direction, and a point of the disk across it
    const double z = 2 * random_double(9, i, 0) - 1, phi = 6.283185307179586 * random_double(9, i, 1),
                 r = std::sqrt(1 - z * z);
    const Vec3f d{float(r * std::cos(phi)), float(r * std::sin(phi)), float(z)};
    const Vec3f u = normalize(std::abs(d.x) < 0.5f ? cross(d, {1, 0, 0}) : cross(d, {0, 1, 0})), v = cross(d, u);
    const float s = 2 * uniform(9, i, 2, -1, 1), t = 2 * uniform(9, i, 3, -1, 1);
    if (s * s + t * t < 4) rays.push_back({u * s + v * t - d * 3, 0, d, kInfinity});
  }
  Counters counters;
  (void)closest_hit(*row, *accel, rays, &counters);
  REQUIRE(counters.nodes > 5000);
  CHECK(double(counters.boxes) / double(counters.nodes) == Approx(seen.steps).epsilon(0.03));
}

TEST_CASE("any hit looks at a ray's end first") {
  TriangleMesh mesh = random_triangles(20000, 0.01f, 16);
  add_triangle(mesh, {4, -4, -2}, {4, 4, -2}, {4, 0, 6});  // a wall behind all others
  std::vector<Ray> to_wall, from_wall;
  for (std::uint64_t i = 0; i < 256; ++i) {
    const Vec3f d{1, uniform(17, i, 0, -0.1f, 0.1f), uniform(17, i, 1, -0.1f, 0.1f)};
    const Vec3f o{0, uniform(17, i, 2, -0.8f, 0.8f), uniform(17, i, 3, -0.8f, 0.8f)};
    to_wall.push_back({o - d * 2, 0, d, i % 2 ? kInfinity : 7.0f});
    from_wall.push_back({o + d * 5, 0, -d, to_wall.back().tfar});
  }
  const std::vector<std::uint8_t> all(to_wall.size(), 1);
  Structures structures(mesh);
  std::set<std::string_view> seen;
  for (const KernelRow& row : runnable_rows()) {
    const std::string_view s = row.structure;
    if (row.intersector != "moller_trumbore" || (s != "grid" && s != "octree" && s != "bih" && s != "kdtree")) continue;
    INFO(name_of(row));
    seen.insert(s);
    Counters to, from;
    REQUIRE(any_hit(row, structures.get(row), to_wall, &to) == all);
    REQUIRE(any_hit(row, structures.get(row), from_wall, &from) == all);
    CHECK(double(to.boxes) < 0.9 * double(from.boxes));
  }
  CHECK(seen.size() == 4);
}

TEST_CASE("a level's cells are numbered in 32 bits, however many triangles are in one place") {
  BuilderParameters p;
  p.grid_density = 64;
  CHECK(grid::wanted_cells(p, 1000) == 64000);
  CHECK(grid::wanted_cells(p, 1000, grid::kOuterShare) == 2000);
  CHECK(grid::wanted_cells(p, 7e7) == grid::kMostCells);
}

TEST_CASE("parameters out of range are named") {
  const TriangleMesh mesh = random_triangles(10, 0.5f, 15);
  BuilderParameters p;
  p.grid_density = 100;
  CHECK_THROWS_WITH(build({"grid", "uniform"}, mesh, "triangle4", 1, p),
                    Catch::Contains("grid_density") && Catch::Contains("0.01 .. 64"));
  p = {}, p.max_depth = 22;
  CHECK_THROWS_WITH(build({"octree", "octants"}, mesh, "triangle4", 1, p),
                    Catch::Contains("max_depth") && Catch::Contains("0 .. 21"));
  p = {}, p.max_leaf_blocks = 9;
  CHECK_THROWS_WITH(build({"bih", "binned_sah"}, mesh, "triangle4", 1, p),
                    Catch::Contains("max_leaf_blocks") && Catch::Contains("1 .. 8"));
  p.max_leaf_blocks = 8;
  CHECK_NOTHROW(build({"bih", "binned_sah"}, mesh, "triangle4", 1, p));
  p = {}, p.grid_density = std::numeric_limits<float>::quiet_NaN();
  CHECK_THROWS_WITH(build({"grid", "uniform"}, mesh, "triangle4", 1, p), "grid_density: nan is not within 0.01 .. 64");
}
