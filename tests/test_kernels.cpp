// The kernel table on every ISA that the machine runs, all rows briefly, those of other code each thoroughly: right
// answers on generic rays, no crack where none is promised, the same answers from any hit, counting kernels, batches of
// any size and other structures.
#include <iostream>
#include <map>
#include <set>

#include "oracle/oracle.h"
#include "structures/accel.h"
#include "tests/catch.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"
#include "tests/small_meshes.h"
#include "traversal/kernel_keys.h"
#include "traversal/ray_order.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

/// What float rounding may do to t on a generic ray: ulps of max(t, extent of the scene over |d|).
constexpr double kMostUlps = 16.0;

/// What an intersector precomputes is precise near the origin alone (docs/numerics.md).
bool loses_far_scenes(const KernelRow& row) {
  return row.intersector == "baldwin_weber" || row.intersector == "havel_herout" ||
         row.intersector == "wald_projection";
}

double ulps(double t, double exact, double scale) {
  return std::abs(t - exact) / (std::max(std::abs(exact), scale) * 0x1p-24);
}

/// Drops the rays within 1e-4 of an edge of the triangle they hit, or that graze it: a float kernel may
/// differ there.
std::vector<Ray> keep_clear(const TriangleMesh& mesh, const std::vector<Ray>& rays) {
  const std::vector<ExactHit> truth = Oracle(mesh).closest_hit(rays);
  std::vector<Ray> kept;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (truth[i].hit.is_hit()) {
      const Hit& hit = truth[i].hit;
      const auto [a, b, c] = mesh.corners(hit.primitive);
      const Vec3f n = normalize(cross(b - a, c - a));
      if (std::min({hit.u, hit.v, 1 - hit.u - hit.v}) < 1e-4f || std::abs(dot(n, normalize(rays[i].direction))) < 0.05f)
        continue;
    }
    kept.push_back(rays[i]);
  }
  return kept;
}

/// Embree's packets and streams do not promise a ray the same bits beside other rays.
bool depends_on_neighbours(const KernelRow& row) { return row.structure == "embree" && row.traversal != "single"; }

}  // namespace

TEST_CASE("every kernel finds the exact primitive on generic rays, and t to within rounding") {
  double worst = 0;
  for (const KernelScene& scene : kernel_scenes()) {
    const std::vector<Ray> rays = keep_clear(scene.mesh, generic_rays(scene.mesh, 420, 99));
    REQUIRE(rays.size() > 250);
    const Oracle oracle(scene.mesh);
    const std::vector<ExactHit> truth = oracle.closest_hit(rays);
    const std::vector<std::uint8_t> any_truth = oracle.any_hit(rays);
    const Vec3f extent = scene.mesh.bounds().extent();
    Structures structures(scene.mesh);
    std::size_t found = 0;
    for (const ExactHit& t : truth) found += t.hit.is_hit();
    CHECK(found > 20);
    for (const KernelRow& row : runnable_rows()) {
      if (loses_far_scenes(row) && (scene.name == "sphere, far" || scene.name == "two scales")) continue;
      INFO(scene.name << ": " << name_of(row));
      const Accel& accel = structures.get(row);
      const std::vector<Hit> hits = closest_hit(row, accel, rays);
      REQUIRE(any_hit(row, accel, rays) == any_truth);
      const bool embree = row.structure == "embree";
      // Embree's Pluecker test takes 1 / (U + V + W) as 0 where that sum is below 1e-18: u and v are lost in small
      // scenes.
      const bool has_coordinates = !(embree && row.intersector == "pluecker" && scene.name == "small");
      const auto right = [&](std::size_t i) {
        const Hit &hit = hits[i], &exact = truth[i].hit;
        if (hit.is_hit() != exact.is_hit()) return false;
        if (!hit.is_hit()) return hit.t == kInfinity;
        // Embree does not break ties by the lowest id.
        if (hit.primitive != exact.primitive && !(embree && truth[i].tie)) return false;
        const double off =
            ulps(hit.t, truth[i].t, length(extent) / length(rays[i].direction)) / (loses_far_scenes(row) ? 4 : 1);
        worst = std::max(worst, off);
        return off <= kMostUlps &&
               (!has_coordinates || (std::abs(hit.u - exact.u) <= 1e-3f && std::abs(hit.v - exact.v) <= 1e-3f));
      };
      require_each(rays.size(), right,
                   [&](std::size_t i) { return text(hits[i]) + "; exactly " + text(truth[i].hit); });
    }
  }
  std::cout << "t was off by at most " << worst << " ulps of max(t, extent / |d|); the bound is " << kMostUlps << "\n";
}

TEST_CASE("every row of the table, none left out, is right on a batch of generic rays") {
  // What follows goes over the rows of runnable_rows(), which are those of other code; this over all of them: a leaf
  // that is laid out or called wrongly in one place only would be seen here.
  const TriangleMesh mesh = random_triangles(300, 0.25f, 21);
  const std::vector<Ray> rays = keep_clear(mesh, generic_rays(mesh, 96, 22));
  REQUIRE(rays.size() > 66);  // a packet of 64 and more
  const Oracle oracle(mesh);
  const std::vector<ExactHit> truth = oracle.closest_hit(rays);
  const std::vector<std::uint8_t> any_truth = oracle.any_hit(rays);
  CHECK(std::ranges::count(any_truth, 1) > 30);
  CHECK(std::ranges::count(any_truth, 0) > 20);
  const double extent = length(mesh.bounds().extent());
  Structures structures(mesh);
  std::size_t rows = 0;
  for (const KernelRow& row : kernel_table()) {
    if (!is_available(row.isa)) continue;
    INFO(name_of(row));
    ++rows;
    const Accel& accel = structures.get(row);
    const std::vector<Hit> hits = closest_hit(row, accel, rays);
    const auto right = [&](std::size_t i) {
      if (!truth[i].hit.is_hit()) return hits[i].primitive == kNoPrimitive && hits[i].t == kInfinity;
      return hits[i].primitive == truth[i].hit.primitive &&
             ulps(hits[i].t, truth[i].t, extent / length(rays[i].direction)) <= kMostUlps;
    };
    require_each(rays.size(), right, [&](std::size_t i) { return text(hits[i]) + "; exactly " + text(truth[i].hit); });
    REQUIRE(any_hit(row, accel, rays) == any_truth);
    if (!row.counts()) continue;
    Counters counters;
    REQUIRE(same_bits(closest_hit(row, accel, rays, &counters), hits));
    REQUIRE(any_hit(row, accel, rays, &counters) == any_truth);
  }
  CHECK(rows >= runnable_rows().size());
  CHECK(rows > 100);  // a structure of one's own has some hundreds, the whole table tens of thousands
}

TEST_CASE("any hit, the counting kernels and batches of any size agree with closest hit") {
  for (const KernelScene& scene : kernel_scenes()) {
    std::vector<Ray> rays = generic_rays(scene.mesh, 60, 7);
    const Bounds3f box = scene.mesh.bounds();
    const std::vector<Ray> aimed = aimed_rays(scene.mesh, box.center() + box.extent() * 3.0f, 60, 8);
    rays.insert(rays.end(), aimed.begin(), aimed.end());
    std::size_t place = 0;
    for (const Ray& ray : invalid_rays()) rays.insert(rays.begin() + std::ptrdiff_t(place), ray), place += 5;
    Structures structures(scene.mesh);
    for (const KernelRow& row : runnable_rows()) {
      INFO(scene.name << ": " << name_of(row));
      const Accel& accel = structures.get(row);
      const std::vector<Hit> hits = closest_hit(row, accel, rays);
      const std::vector<std::uint8_t> occluded = any_hit(row, accel, rays);
      // Rays aimed at edges, half of them all: two kernels of Embree's may round apart there
      std::size_t differing = 0;
      const auto agree = [&](std::size_t i) {
        const bool same = occluded[i] == std::uint8_t(hits[i].is_hit());
        differing += !same;
        return (same || depends_on_neighbours(row)) && (is_valid(rays[i]) || !hits[i].is_hit()) &&
               (hits[i].is_hit() || hits[i].t == kInfinity);
      };
      require_each(rays.size(), agree,
                   [&](std::size_t i) { return text(hits[i]) + ", any hit " + std::to_string(occluded[i]); });
      REQUIRE(differing <= rays.size() / 10);
      for (std::size_t size : {std::size_t(0), std::size_t(1), std::size_t(3), std::size_t(17)}) {
        INFO("batch of " << size);
        const std::vector<Ray> part(rays.begin() + 2, rays.begin() + 2 + std::ptrdiff_t(size));
        const std::vector<Hit> got = closest_hit(row, accel, part);
        const auto want = std::span(hits).subspan(2, size);
        if (depends_on_neighbours(row)) continue;  // tests/test_embree.cpp does
        REQUIRE(same_bits(got, want));
        REQUIRE(std::ranges::equal(any_hit(row, accel, part), std::span(occluded).subspan(2, size)));
      }
      if (!row.counts()) {
        CHECK(row.structure == "embree");
        continue;
      }
      Counters closest, any;
      REQUIRE(same_bits(closest_hit(row, accel, rays, &closest), hits));
      REQUIRE(any_hit(row, accel, rays, &any) == occluded);
      for (const Counters& c : {closest, any}) {
        REQUIRE(c.rays == rays.size());
        REQUIRE(c.leaves > 0);
        REQUIRE(c.blocks >= c.leaves);
        REQUIRE(c.triangles >= c.blocks);
        REQUIRE(c.lanes_active == c.boxes + c.triangles);
        REQUIRE(c.lanes >= c.lanes_active);
        // A packet's test of a child may say that all of its rays meet it, without a test of each; a plane of the
        // kd-tree that is met behind all of them leaves its rays one cell.
        const std::uint64_t together = row.traversal == "auto" ? 64 : std::uint64_t(packet_width(row.traversal));
        const std::uint64_t by_interval = row.structure != "kdtree" ? together * c.interval_tests
                                          : together != 0           ? c.nodes
                                                                    : 0;
        REQUIRE(c.boxes_hit <= c.boxes + by_interval);
      }
      // A ray that meets nothing goes the same way, whatever is asked.
      std::vector<Ray> missing;
      for (std::size_t i = 0; i < rays.size(); ++i)
        if (!hits[i].is_hit()) missing.push_back(rays[i]);
      Counters none_closest, none_any;
      (void)closest_hit(row, accel, missing, &none_closest), (void)any_hit(row, accel, missing, &none_any);
      const bool go_on_alone = row.traversal == "packet32" || row.traversal == "packet64" || row.traversal == "auto" ||
                               row.traversal.starts_with("hybrid");
      if (row.structure == "grid" && go_on_alone) {
        // Together rays are counted in all cells that they may be in, alone in those that they are in; which go on
        // alone, and from where, depends on the end that slices are passed from.
        Counters alone, together;
        for (const auto& [way, counters] : {std::pair{"single", &alone}, std::pair{"packet16", &together}})
          (void)closest_hit(*find_kernel(row.structure, row.leaf, row.intersector, row.box, way, row.isa), accel,
                            missing, counters);
        for (const Counters& c : {none_closest, none_any}) {
          REQUIRE(c.nodes >= alone.nodes);
          REQUIRE(c.nodes <= together.nodes);
        }
        continue;
      }
      REQUIRE(none_any.nodes == none_closest.nodes);
      REQUIRE(none_any.boxes_hit == none_closest.boxes_hit);
      REQUIRE(none_any.triangles == none_closest.triangles);
    }
  }
}

TEST_CASE("with padded boxes every structure gives the brute force's answers, bit for bit") {
  for (const KernelScene& scene : kernel_scenes()) {
    std::vector<Ray> rays = generic_rays(scene.mesh, 150, 21);
    const Bounds3f box = scene.mesh.bounds();
    for (const Vec3f from : {box.center() + box.extent() * 2.0f, box.center(), box.lower}) {
      const std::vector<Ray> aimed = aimed_rays(scene.mesh, from, 100, 22);
      rays.insert(rays.end(), aimed.begin(), aimed.end());
    }
    Structures structures(scene.mesh);
    std::size_t compared = 0;
    std::map<const KernelRow*, std::vector<Hit>> wanted;
    for (const KernelRow& row : runnable_rows()) {
      if (row.box != "padded" || row.structure == "embree" || row.structure == "brute_force") continue;
      const KernelRow* reference = find_kernel("brute_force", row.leaf, row.intersector, row.box, "single", row.isa);
      if (!reference) continue;
      // Seen from 1e6 away the other tests are wrong by more than a small triangle, and by more than its box is
      // padded.
      if (scene.name == "two scales" && !row.intersector.starts_with("watertight") &&
          !row.intersector.ends_with("_double"))
        continue;
      INFO(scene.name << ": " << name_of(row));
      ++compared;
      std::vector<Hit>& want = wanted[reference];
      if (want.empty()) want = closest_hit(*reference, structures.get(*reference), rays);
      const std::vector<Hit> got = closest_hit(row, structures.get(row), rays);
      require_each(
          rays.size(),
          [&](std::size_t i) { return same_bits(std::span(got).subspan(i, 1), std::span(want).subspan(i, 1)); },
          [&](std::size_t i) { return text(got[i]) + "; brute force: " + text(want[i]); });
    }
    CHECK(compared >= 2);  // a lone structure has one intersector here on each instruction set
  }
}

/// Whether a way of traversal visits nodes in another order than a single ray. With `fast` boxes, which may begin
/// behind their triangles by a rounding, that can change which of two triangles at nearly one distance is found.
bool reorders(const KernelRow& row) {
  return !row.traversal.starts_with("queued") && row.traversal != "single" && row.box == "fast";
}

/// Whether the intersector may be off by more than a small triangle's box is padded, from as far away as rays come in
/// that scene: then what is found first may cull another triangle at nearly the same distance.
bool leaves_boxes(const KernelRow& row, const KernelScene& scene) {
  return scene.name == "two scales" && row.intersector == "pluecker";
}

/// Hits and misses alike, and t the same but for such roundings.
bool nearly_same(std::span<const Hit> a, std::span<const Hit> b, float extent) {
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a[i].is_hit() != b[i].is_hit()) return false;
    if (a[i].is_hit() && !(std::abs(a[i].t - b[i].t) <= 0x1p-18f * std::max(std::abs(a[i].t), extent))) return false;
  }
  return a.size() == b.size();
}

TEST_CASE("every way of traversal gives the single ray's answers, bit for bit") {
  std::set<std::string_view> traversals;
  for (const KernelScene& scene : kernel_scenes()) {
    std::vector<Ray> rays = generic_rays(scene.mesh, 150, 31);
    const Vec3f centre = scene.mesh.bounds().center();
    const float extent = length(scene.mesh.bounds().extent()) + length(centre);
    const std::vector<Ray> aimed = aimed_rays(scene.mesh, centre, 100, 32);
    rays.insert(rays.end(), aimed.begin(), aimed.end());
    for (int i = 0; i < 150; ++i) {  // from one point, close together: what packets are for
      const Vec3f target = centre + Vec3f{float(i % 12) - 6.0f, float(i / 12) - 6.0f, 0.0f} * (extent * 0.04f);
      const Vec3f eye = centre + Vec3f{0.3f, 0.2f, 2.0f} * extent;
      rays.push_back({eye, 0, target - eye, kInfinity});
    }
    std::size_t place = 0;
    for (const Ray& ray : invalid_rays()) rays.insert(rays.begin() + std::ptrdiff_t(place), ray), place += 7;
    Structures structures(scene.mesh);
    Answers singles(structures, rays);
    for (const KernelRow& row : runnable_rows()) {
      if (row.traversal == "single" || row.structure == "embree") continue;
      traversals.insert(row.traversal);
      INFO(scene.name << ": " << name_of(row));
      const KernelRow* single = find_kernel(row.structure, row.leaf, row.intersector, row.box, "single", row.isa);
      REQUIRE(single);
      const Accel& accel = structures.get(row);
      const auto& [alone, occluded] = singles.of(*single);
      for (std::size_t size : {std::size_t(0), std::size_t(1), std::size_t(5), std::size_t(33), rays.size()}) {
        INFO("batch of " << size);
        // So that a read beyond it is one beyond memory
        const std::vector<Ray> batch(rays.begin(), rays.begin() + std::ptrdiff_t(size));
        const std::span<const Hit> want = std::span(alone).first(size);
        const std::vector<Hit> hits = closest_hit(row, accel, batch);
        const bool may_differ = reorders(row) || leaves_boxes(row, scene);
        REQUIRE((same_bits(hits, want) || (may_differ && nearly_same(hits, want, extent))));
        REQUIRE(std::ranges::equal(any_hit(row, accel, batch), std::span(occluded).first(size)));
      }
    }
  }
  CHECK(traversals.count("queued") == (find_structure("bvh8") || find_structure("kdtree") ? 1u : 0u));
}

TEST_CASE("streams of one to many groups give the single ray's answers, bit for bit") {
  const std::size_t sizes[] = {1, 2, 3, 4, 5, 7, 8, 9, 15, 16, 17, 31, 32, 33, 1023, 1024, 1025, 2100};
  for (const TriangleMesh& mesh : {random_triangles(3000, 0.1f, 2), sphere(40)}) {
    std::vector<Ray> rays = generic_rays(mesh, 1100, 41);
    const std::vector<Ray> aimed = aimed_rays(mesh, mesh.bounds().center(), 1000, 42);  // every octant, coherent
    rays.insert(rays.end(), aimed.begin(), aimed.end());
    std::size_t place = 1;
    for (const Ray& ray : invalid_rays()) rays[place] = ray, place += 11;
    Structures structures(mesh);
    Answers singles(structures, rays);
    for (const KernelRow& row : runnable_rows()) {
      if (!row.traversal.starts_with("stream") || row.box != "padded") continue;
      INFO(name_of(row));
      const Accel& accel = structures.get(row);
      const KernelRow* single = find_kernel(row.structure, row.leaf, row.intersector, row.box, "single", row.isa);
      REQUIRE(single);
      const auto& [alone, occluded] = singles.of(*single);
      for (std::size_t size : sizes) {
        INFO("batch of " << size);
        const std::span<const Ray> batch = std::span(rays).first(size);
        REQUIRE(same_bits(closest_hit(row, accel, batch), std::span(alone).first(size)));
        REQUIRE(std::ranges::equal(any_hit(row, accel, batch), std::span(occluded).first(size)));
      }
    }
  }
}

// Packets bound rays that end in one place from there (structures/bvh/bvh_packet.h): no occluder may be lost by it.
TEST_CASE("rays that end in one place are occluded in packets as they are alone") {
  for (const TriangleMesh& mesh : {random_triangles(3000, 0.1f, 2), sphere(40)}) {
    const Vec3f center = mesh.bounds().center();
    std::vector<Ray> rays;
    std::uint64_t drawn = 0;
    const auto jitter = [&](float size) {
      const std::uint64_t i = drawn++;
      return Vec3f{random_float(77, i, 0) - 0.5f, random_float(77, i, 1) - 0.5f, random_float(77, i, 2) - 0.5f} * size;
    };
    for (const Vec3f& end :
         {center, mesh.vertices[5], center + Vec3f{0.3f, 2.5f, 0.1f}, center + Vec3f{2e3f, -1e4f, 3e3f}}) {
      for (int tile = 0; tile < 12; ++tile) {
        const Vec3f place = center + jitter(2.0f);
        for (int i = 0; i < 64; ++i) {
          const Vec3f origin = place + jitter(0.05f), way = end - origin;
          const float length = std::sqrt(dot(way, way));
          // Every third tile's directions have the length of the way, and some rays of the last tiles end half-way.
          const bool whole = tile % 3 == 0, half = tile > 8 && i % 5 == 0;
          rays.push_back(
              {origin, 0.0f, whole ? way : way * (1.0f / length), (whole ? 1.0f : length) * (half ? 0.5f : 1.0f)});
        }
      }
    }
    // Parallel rays end far away, at the same place as far as floats can tell; two of the directions are 0 along an
    // axis.
    for (const Vec3f& direction : {Vec3f{0.6f, 0.8f, 0.0f}, Vec3f{0.0f, 0.0f, -1.0f}, Vec3f{0.48f, 0.6f, 0.64f}}) {
      for (float tfar : {1e6f, 1e13f, 1e30f, std::numeric_limits<float>::max()}) {
        const Vec3f place = center - direction;
        for (int i = 0; i < 64; ++i) rays.push_back({place + jitter(i % 2 ? 0.9f : 0.05f), 0.0f, direction, tfar});
      }
    }
    Structures structures(mesh);
    Answers singles(structures, rays);
    std::set<std::string_view> traversals;
    for (const KernelRow& row : runnable_rows()) {
      if (!row.traversal.starts_with("packet") && !row.traversal.starts_with("hybrid") && row.traversal != "auto")
        continue;
      if (depends_on_neighbours(row)) continue;
      INFO(name_of(row));
      const Accel& accel = structures.get(row);
      const KernelRow* single = find_kernel(row.structure, row.leaf, row.intersector, row.box, "single", row.isa);
      REQUIRE(single);
      const std::vector<std::uint8_t>& alone = singles.of(*single).any;
      const auto hits = std::ranges::count(alone, 1);
      REQUIRE((hits > 200 && hits < std::ptrdiff_t(rays.size()) - 200));
      REQUIRE(any_hit(row, accel, rays) == alone);
      traversals.insert(row.traversal);
    }
    CHECK(traversals.count("packet64") == (find_structure("bvh8") ? 1u : 0u));
  }
}

// What rays of one origin share of a leaf (intersectors/moller_trumbore.h: FromOrigin) is what each would compute, and
// rays of nearly one do not share it.
TEST_CASE("rays of one origin get in packets what they get alone, bit for bit") {
  // Triangles large enough for all rays of a packet to be in one leaf, some with corners at 0 and planes through the
  // origins.
  TriangleMesh mesh = random_triangles(300, 0.8f, 9);
  for (int i = 0; i < 12; ++i) {
    const float x = 0.1f * float(i % 4), y = i % 3 == 0 ? -0.0f : 0.1f * float(i % 3);
    add_triangle(mesh, {0, 0, 0}, {1, x, y}, {x, 1, -y}), add_triangle(mesh, {-0.0f, y, 1}, {0, -1, x}, {-1, 0, -0.0f});
  }
  std::vector<Ray> rays;
  std::uint64_t drawn = 0;
  const auto draw = [&] { return random_float(78, drawn++, 0) - 0.5f; };
  for (const Vec3f& origin :
       {Vec3f{0, 0, 0}, Vec3f{0, 0, -3}, Vec3f{2, 1.5f, 0}, Vec3f{-0.3f, 0.2f, 0.1f}, mesh.vertices[4]}) {
    for (int tile = 0; tile < 24; ++tile) {
      const Vec3f towards = Vec3f{draw(), draw(), draw()} - origin;
      for (int i = 0; i < 64; ++i) {
        Vec3f from = origin;
        if (tile % 4 == 1 && i % 7 == 0)
          for (std::size_t a = 0; a < 3; ++a) from[a] = from[a] == 0 ? -0.0f : from[a];
        if (tile % 4 == 2 && i == 33) from.y = std::nextafter(from.y, 1.0f);
        rays.push_back({from, 0.0f, towards + Vec3f{draw(), draw(), draw()} * (tile % 2 ? 0.05f : 0.4f), kInfinity});
      }
    }
  }
  Structures structures(mesh);
  Answers singles(structures, rays);
  std::set<std::string_view> traversals;
  for (const KernelRow& row : runnable_rows()) {
    if ((!row.traversal.starts_with("packet") && row.traversal != "auto") || row.box != "padded" ||
        depends_on_neighbours(row))
      continue;
    INFO(name_of(row));
    const Accel& accel = structures.get(row);
    const KernelRow* single = find_kernel(row.structure, row.leaf, row.intersector, row.box, "single", row.isa);
    REQUIRE(single);
    const std::vector<Hit>& alone = singles.of(*single).closest;
    REQUIRE(std::ranges::count_if(alone, &Hit::is_hit) > std::ptrdiff_t(rays.size() / 2));
    REQUIRE(same_bits(closest_hit(row, accel, rays), alone));
    traversals.insert(row.traversal);
  }
  CHECK(traversals.count("packet64") == (find_structure("bvh8") ? 1u : 0u));
}

TEST_CASE("the order of sorted streams: every ray once, octant after octant") {
  std::vector<Ray> rays = generic_rays(random_triangles(50, 0.3f, 1), 3000, 5);
  for (const Ray& ray : invalid_rays()) rays.push_back(ray);
  for (std::size_t size : {std::size_t(0), std::size_t(1), std::size_t(40), rays.size()}) {
    const std::vector<std::uint32_t> order = ray_order(std::span<const Ray>(rays).first(size));
    std::set<int> octants;
    int last = -1;
    for (std::uint32_t i : order) {
      const Vec3f d = rays[i].direction;
      const int octant = std::signbit(d.x) * 4 + std::signbit(d.y) * 2 + std::signbit(d.z);
      if (octant != last) CHECK(octants.insert(octant).second);
      last = octant;
    }
    CHECK(std::set<std::uint32_t>(order.begin(), order.end()).size() == size);
    CHECK(order.size() == size);
  }
}

TEST_CASE("what promises it has, with padded boxes, no crack in a closed mesh") {
  for (std::uint32_t rings : {3u, 12u, 40u}) {
    for (float offset : {0.0f, 100.0f, 1e4f}) {
      const TriangleMesh mesh = moved(sphere(rings), 1.0f, {offset, -offset, offset});
      const Vec3f inside{offset + 0.1f, -offset - 0.2f, offset + 0.05f};
      const std::vector<Ray> rays = aimed_rays(mesh, inside, 2000, 5);
      Structures structures(mesh);
      for (const KernelRow& row : runnable_rows()) {
        if ((row.intersector != "watertight" && row.intersector != "watertight_refined") || row.box != "padded")
          continue;
        if (row.structure == "brute_force" && rings == 40) continue;  // 6240 triangles: slow, and nothing new
        INFO(rings << " rings at " << offset << ": " << name_of(row));
        std::size_t cracks = 0;
        for (const Hit& hit : closest_hit(row, structures.get(row), rays)) cracks += !hit.is_hit();
        CHECK(cracks == 0);
      }
    }
  }
}

TEST_CASE("an empty mesh is missed") {
  const TriangleMesh mesh;
  Structures structures(mesh);
  const std::vector<Ray> rays{{{0, 0, -1}, 0, {0, 0, 1}, kInfinity}, {{0, 0, 0}, 0, {0, 0, 0}, 0}};
  for (const KernelRow& row : runnable_rows()) {
    INFO(name_of(row));
    for (const Hit& hit : closest_hit(row, structures.get(row), rays)) CHECK_FALSE(hit.is_hit());
    CHECK(any_hit(row, structures.get(row), rays) == std::vector<std::uint8_t>{0, 0});
  }
}

TEST_CASE("the kernel table has every structure, and names each row once") {
  std::set<std::string> names;
  std::set<std::string_view> structures;
  for (const KernelRow& row : kernel_table()) {
    INFO(name_of(row));
    CHECK(names.insert(name_of(row)).second);
    structures.insert(row.structure);
    REQUIRE(find_structure(row.structure));
    const auto& leaves = find_structure(row.structure)->info.leaves;
    CHECK(std::ranges::find(leaves, row.leaf) != leaves.end());
    REQUIRE(row.timed.closest_hit);
    REQUIRE(row.timed.any_hit);
    CHECK((row.counting.closest_hit == nullptr) == (row.counting.any_hit == nullptr));
    CHECK(find_kernel(row.structure, row.leaf, row.intersector, row.box, row.traversal, row.isa) == &row);
    CHECK(why_no_kernel(row.structure, row.leaf, row.intersector, row.box, row.traversal, row.isa).empty());
  }
  for (const StructureEntry& entry : all_structures()) CHECK(structures.count(entry.info.name) == 1);
  for (Isa isa : kAllIsas) {
    if (!is_available(isa)) std::cout << "skipped: " << to_string(isa) << ", not available here\n";
  }
}

TEST_CASE("what has no kernel says why: which instruction sets, leaves or loops there are") {
  const auto why = [](std::string_view structure, std::string_view leaf, std::string_view traversal, Isa isa) {
    return why_no_kernel(structure, leaf, "moller_trumbore", "fast", traversal, isa);
  };
  // a program may have others, and fewer of ours
  const auto here = [](std::string_view structure) { return find_structure(structure) != nullptr; };
  if (here("bvh8")) {
    CHECK(why("bvh8", "triangle8", "single", Isa::scalar) == "bvh8 has triangle8 with sse, avx2, avx512 only");
    for (Isa isa : {Isa::scalar, Isa::sse, Isa::avx2})
      if (cpu_supports(isa)) CHECK(why("bvh8", "triangle16", "single", isa) == "bvh8 has triangle16 with avx512 only");
  }
  if (here("kdtree") && here("embree"))
    CHECK(why_no_kernel("kdtree", "triangle4", "moller_trumbore", "fast", "stream_coherent", Isa::scalar) ==
          "kdtree has no stream_coherent traversal: that is for embree");
  if (here("bvh4_motion"))
    CHECK(why("bvh4_motion", "triangle4", "single", Isa::scalar) ==
          "bvh4_motion has no leaf triangle4: it has triangle4i");
  // What a reason says of an instruction set is what the table has.
  for (const StructureEntry& entry : all_structures()) {
    for (Isa isa : available_isas()) {
      for (std::string_view leaf : entry.info.leaves) {
        const bool there = std::ranges::any_of(kernel_table(), [&](const KernelRow& r) {
          return r.structure == entry.info.name && r.leaf == leaf && r.isa == isa;
        });
        if (there || entry.info.build_depends_on_isa) continue;
        INFO(entry.info.name << " " << leaf << " " << to_string(isa));
        const std::string reason = why_no_kernel(entry.info.name, leaf, "moller_trumbore", "fast", "single", isa);
        const std::size_t with = reason.find(" with ");
        REQUIRE(with != std::string::npos);
        CHECK(reason.find(to_string(isa), with) == std::string::npos);
      }
    }
    // Every structure of ours that lacks rays in flight or streams has a reason of its own, not a list of those that
    // have them.
    for (std::string_view traversal : {"queued", "queued16", "stream", "stream_sorted", "stream_lists"}) {
      const bool there = std::ranges::any_of(kernel_table(), [&](const KernelRow& r) {
        return r.structure == entry.info.name && r.traversal == traversal;
      });
      if (there || entry.info.build_depends_on_isa) continue;
      const std::string reason =
          why_no_kernel(entry.info.name, entry.info.leaves.front(), "moller_trumbore", "fast", traversal, Isa::scalar);
      INFO(entry.info.name << " " << traversal << ": " << reason);
      CHECK(reason.find("that is for") == std::string::npos);
      CHECK_FALSE(reason.ends_with(": not built"));
      CHECK(reason.find(std::string(entry.info.name) + " has no " + std::string(traversal) + " traversal: ") == 0);
    }
  }
}
