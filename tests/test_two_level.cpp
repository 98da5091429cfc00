// two_level: what stands below answers bit for bit while nothing is transformed; with transforms the answers are those
// of the flat mesh; prototypes are held once; what cannot stand below is refused in one line.
#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <map>

#include "core/instances.h"
#include "intersectors/promises.h"
#include "oracle/hard_rays.h"
#include "oracle/oracle.h"
#include "rendering/workload.h"
#include "scenes/layout.h"
#include "structures/statistics.h"
#include "structures/builders/builders.h"
#include "structures/two_level/two_level.h"
#include "tests/catch.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"
#include "tests/scene_files.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

std::unique_ptr<Accel> built(std::string_view name, const TriangleMesh& mesh, std::string_view leaf,
                             const std::string& below = "bvh8", std::string builder = {}) {
  BuildSettings settings;
  settings.leaf = leaf, settings.isa = best_isa(), settings.parameters.below = below;
  settings.builder = builder.empty() ? std::string(find_structure(name)->info.builders.front()) : builder;
  BuildReport report;
  return build_structure(name, mesh, settings, report);
}

/// Rows of two_level whose structure below has the same kernel.
std::vector<KernelRow> rows_over(std::string_view below) {
  std::vector<KernelRow> rows;
  for (const KernelRow& row : runnable_rows())
    if (row.structure == "two_level" && find_kernel(below, row.leaf, row.intersector, row.box, row.traversal, row.isa))
      rows.push_back(row);
  return rows;
}

/// The rows of two_level with that leaf, padded boxes and an intersector of which all ways of traversal are held to the
/// same bits, those whose structure below has the same kernel.
std::vector<KernelRow> padded_rows(std::string_view below, std::string_view leaf) {
  std::vector<KernelRow> rows;
  for (const KernelRow& row : kernel_table())
    if (row.structure == "two_level" && row.leaf == leaf && row.box == "padded" && is_available(row.isa) &&
        (row.intersector == "watertight" || row.intersector == "exact") &&
        find_kernel(below, row.leaf, row.intersector, row.box, row.traversal, row.isa))
      rows.push_back(row);
  return rows;
}

AffineMap map_of(double angle, double scale, Vec3f move) {
  const double c = scale * std::cos(angle), s = scale * std::sin(angle);
  return {{{c, -s, 0, move.x}, {s, c, 0, move.y}, {0, 0, scale, move.z}}};
}

/// Spheres and soups at many places, some touching, all turned, one mirrored and squashed.
TriangleMesh placed_meshes() {
  Layout layout;
  const std::uint32_t ball = layout.add_part(sphere(8)), soup = layout.add_part(random_triangles(60, 0.4f, 3));
  for (int i = 0; i < 12; ++i) {
    layout.place(i % 3 ? ball : soup,
                 map_of(0.7 * i, 0.3 + 0.1 * i, {float(i % 4) * 1.7f, float(i / 4) * 1.9f, 0.2f * float(i)}), 0);
  }
  AffineMap squashed = map_of(0.3, 1.0, {-2, 1, 0.5f});
  for (double& x : squashed.m[1]) x *= -0.25;
  layout.place(ball, squashed, 0);
  layout.place(soup, AffineMap{}, 0);
  return layout.take(true);
}

}  // namespace

TEST_CASE("a scene without instances is answered by the structure below, bit for bit") {
  const TriangleMesh mesh = random_triangles(700, 0.2f, 11);
  std::vector<Ray> rays = generic_rays(mesh, 300, 5);
  for (const Ray& ray : invalid_rays()) rays.push_back(ray);
  for (const StructureEntry& entry : all_structures()) {
    if (!why_not_below(entry.info).empty()) continue;
    const std::string below(entry.info.name);
    for (const KernelRow& row : rows_over(below)) {
      INFO(name_of(row) << " over " << below);
      const std::string builder(entry.info.builders.front());
      const auto two = built("two_level", mesh, row.leaf, below, builder),
                 one = built(below, mesh, row.leaf, below, builder);
      const KernelRow& direct = *find_kernel(below, row.leaf, row.intersector, row.box, row.traversal, row.isa);
      CHECK(same_bits(closest_hit(row, *two, rays), closest_hit(direct, *one, rays)));
      CHECK(any_hit(row, *two, rays) == any_hit(direct, *one, rays));
    }
  }
}

TEST_CASE("with transforms the answers are those of the flat mesh") {
  const TriangleMesh mesh = placed_meshes();
  REQUIRE(mesh.instancing);
  CHECK(mesh.instancing->prototypes.size() == 2);
  CHECK(mesh.instancing->instances.size() == 14);
  const std::vector<Ray> rays = generic_rays(mesh, 4000, 6);
  const Oracle oracle(mesh);
  const auto truth = oracle.closest_hit(rays);
  const auto any_truth = oracle.any_hit(rays);
  for (const KernelRow& row : rows_over("bvh8")) {
    INFO(name_of(row));
    const auto two = built("two_level", mesh, row.leaf), flat = built("bvh8", mesh, row.leaf);
    const std::vector<Hit> hits = closest_hit(row, *two, rays);
    const std::vector<std::uint8_t> occluded = any_hit(row, *two, rays);
    const AnswerCheck check = oracle.check_closest_hit(rays, truth, hits);
    CAPTURE(check.missed_hits, check.false_hits, check.wrong_surface);
    CHECK(check.wrong_answers() == 0);
    CHECK(oracle.check_any_hit(rays, any_truth, occluded).wrong_answers() == 0);
    // Where both find the same triangle t, u and v are the same bits.
    const std::vector<Hit> want =
        closest_hit(*find_kernel("bvh8", row.leaf, row.intersector, row.box, "single", row.isa), *flat, rays);
    std::size_t same = 0, hit = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      REQUIRE(occluded[i] == std::uint8_t(hits[i].is_hit()));
      hit += want[i].is_hit();
      if (!want[i].is_hit() || hits[i].primitive != want[i].primitive) continue;
      ++same;
      REQUIRE(same_bits({&hits[i], 1}, {&want[i], 1}));
    }
    CHECK(hit > 500);
    CHECK(same >= hit - 4);
  }
}

namespace {

/// A map of each kind, times `scale`: turned about two axes, sheared, mirrored, squashed, the identity.
std::vector<AffineMap> maps_of(double scale, Vec3f move) {
  std::vector<AffineMap> maps;
  for (int i = 0; i < 6; ++i) {
    AffineMap map = map_of(0.7 * i, 1.0, {move.x + 1.9f * float(scale) * float(i), move.y, move.z});
    const double c = std::cos(0.4 * i), s = std::sin(0.4 * i);
    for (int k = 0; k < 3; ++k) {  // about x
      const double y = map.m[1][k], z = map.m[2][k];
      map.m[1][k] = c * y - s * z, map.m[2][k] = s * y + c * z;
    }
    if (i == 2)
      for (auto& row : map.m) row[1] += 1.5 * row[0];
    if (i == 3)
      for (auto& row : map.m) row[2] *= -1.0;
    if (i == 4)
      for (auto& row : map.m) row[0] *= 0.03;
    for (auto& row : map.m)
      for (int k = 0; k < 3; ++k) row[k] *= scale;
    maps.push_back(map);
  }
  return maps;
}

/// Rays aimed at what goes wrong. Of those in a triangle's plane `watertight` without fused multiply-add answers t
/// anywhere between its corners, so that boxes decide which triangle is found: they are left out for it.
std::vector<Ray> hard_rays(const TriangleMesh& mesh, std::size_t count, bool grazing) {
  const HardRayMaker maker(mesh);
  std::vector<HardKind> kinds;
  for (std::size_t k = 0; k < kMadeKinds; ++k)
    if (maker.has(HardKind(k)) && (grazing || HardKind(k) != HardKind::grazing)) kinds.push_back(HardKind(k));
  return maker.make(3, 0, count, kinds).rays;
}

/// Every row of two_level over `below` with padded boxes and an intersector that promises something, against bvh8 over
/// the flat mesh. Returns the hits that were compared.
std::size_t same_as_flat(const TriangleMesh& mesh, const std::string& below, const std::string& builder,
                         std::initializer_list<std::string_view> leaves, std::size_t count) {
  struct Pair {
    std::unique_ptr<Accel> two, flat;
  };
  std::map<std::string_view, Pair> trees;  // by leaf
  for (std::string_view leaf : leaves)
    trees.emplace(leaf, Pair{built("two_level", mesh, leaf, below, builder), built("bvh8", mesh, leaf)});
  const std::vector<Ray> with_grazing = hard_rays(mesh, count, true), without_grazing = hard_rays(mesh, count, false);
  std::size_t found = 0;
  for (const KernelRow& row : kernel_table()) {
    if (row.structure != "two_level" || row.box != "padded" || !is_available(row.isa)) continue;
    if (!is_structure_independent(row.intersector)) continue;
    // Ways of traversal differ in the boxes that they visit, whatever the test: two with one test stand for all here.
    const bool packets = row.traversal == "packet16" || row.traversal == "packet64";
    if (row.traversal != "single" && !(packets && row.intersector == "watertight")) continue;
    const auto tree = trees.find(row.leaf);
    if (tree == trees.end()) continue;
    const KernelRow* of_flat = find_kernel("bvh8", row.leaf, row.intersector, row.box, "single", row.isa);
    if (!of_flat || !find_kernel(below, row.leaf, row.intersector, row.box, row.traversal, row.isa)) continue;
    const bool fused = row.isa == Isa::avx2 || row.isa == Isa::avx512;
    const std::vector<Ray>& rays = fused || row.intersector == "exact" ? with_grazing : without_grazing;
    const auto& [two, flat] = tree->second;
    const std::vector<Hit> hits = closest_hit(row, *two, rays), want = closest_hit(*of_flat, *flat, rays);
    const std::vector<std::uint8_t> any = any_hit(row, *two, rays), any_want = any_hit(*of_flat, *flat, rays);
    std::size_t differ = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      found += want[i].is_hit();
      if (same_bits({&hits[i], 1}, {&want[i], 1}) && any[i] == any_want[i]) continue;
      INFO(name_of(row) << " over " << below << ", ray " << i << ": " << text(hits[i]) << ", flat " << text(want[i]));
      FAIL_CHECK("not the same bits");
      ++differ;
      if (differ > 3) break;
    }
  }
  return found;
}

}  // namespace

TEST_CASE("over instances answers are those of the flat mesh, bit for bit, whatever the maps") {
  const struct {
    double scale;
    Vec3f move;
  } places[] = {{1.0, {}},
                {0x1p-20, {}},
                {0x1p20, {}},
                {1.0, {1e5f, -3e4f, 2e4f}},
                {0x1p-8, {300, 200, -100}},
                {0x1p-20, {1, 2, 3}},
                {0x1p20, {-1e8f, 0, 1e7f}}};
  for (const auto& place : places) {
    INFO("scale " << place.scale << ", moved by " << place.move.x);
    Layout layout;
    const std::uint32_t ball = layout.add_part(sphere(8)), soup = layout.add_part(random_triangles(60, 0.4f, 3)),
                        far = layout.add_part(moved(sphere(6), 1.0f, {40, 0, -9}));
    for (const AffineMap& map : maps_of(place.scale, place.move))
      layout.place(ball, map, 0), layout.place(soup, map, 0), layout.place(far, map, 0);
    const TriangleMesh mesh = layout.take(true);
    REQUIRE(mesh.instancing);
    CHECK(same_as_flat(mesh, "bvh8", "binned_sah", {"triangle4v", "triangle4i"}, 3000) > 10000);
  }
}

TEST_CASE("over instances answers are those of the flat mesh, bit for bit, whatever stands below") {
  Layout layout;
  const std::uint32_t ball = layout.add_part(sphere(8)), soup = layout.add_part(random_triangles(60, 0.4f, 3));
  for (const double scale : {1.0, 0.01})
    for (const AffineMap& map : maps_of(scale, {})) layout.place(ball, map, 0), layout.place(soup, map, 0);
  layout.place(soup, AffineMap{}, 0);
  const TriangleMesh mesh = layout.take(true);
  REQUIRE(mesh.instancing);
  for_each_type(two_level::Searchable{}, [&]<class Below>(std::type_identity<Below>) {
    const std::string builder(find_structure(Below::kName)->info.builders.front());
    CHECK(same_as_flat(mesh, std::string(Below::kName), builder, {"triangle1v", "triangle8v"}, 2000) > 3000);
  });
}

TEST_CASE("over instances that overlap answers are those of the flat mesh, bit for bit, whatever builds the top") {
  // So many, so close, that builders which split triangles would split what stands for an instance.
  Layout layout;
  const std::uint32_t ball = layout.add_part(sphere(4));
  for (int i = 0; i < 90; ++i) {
    const Vec3f at{float(i % 9) * 0.4f, float(i / 9 % 5) * 0.3f, float(i / 45) * 0.7f};
    layout.place(ball, map_of(0.3 * i, 0.5 + 0.02 * i, at), 0);
  }
  const TriangleMesh mesh = layout.take(true);
  REQUIRE(mesh.instancing);
  for (const std::string_view builder : binary_builder_names()) {
    INFO(builder);
    CHECK(same_as_flat(mesh, "bvh8", std::string(builder), {"triangle8v"}, 1500) > 3000);
  }
}

TEST_CASE(
    "a mesh that a program laid out in float, with triangles that have an area in one space alone, is answered as it "
    "is") {
  Instancing instancing;
  TriangleMesh part = sphere(6), mesh;
  // Collinear before the map and hardly after it.
  const auto first = std::uint32_t(part.vertices.size());
  part.vertices.insert(part.vertices.end(), {{-2, -2, -2}, {0.1f, 0.1f, 0.1f}, {3, 3, 3}});
  part.triangles.push_back({first, first + 1, first + 2});
  instancing.prototypes = {part};
  for (const bool in_float : {false, true}) {
    mesh = {}, instancing.instances.clear();
    for (const AffineMap& map : maps_of(0.7, {5, 6, 7})) {
      instancing.instances.push_back({0, std::uint32_t(mesh.size()), map});
      const auto vertex = std::uint32_t(mesh.vertices.size());
      for (const Vec3f& v : part.vertices) {
        const auto row = [&](const double(&r)[4]) {
          return float(r[3]) + (float(r[2]) * v.z + float(r[1]) * v.y) + float(r[0]) * v.x;
        };
        mesh.vertices.push_back(in_float ? Vec3f{row(map.m[0]), row(map.m[1]), row(map.m[2])}
                                         : transform_point(map, v));
      }
      for (const Triangle& t : part.triangles) mesh.triangles.push_back({t.a + vertex, t.b + vertex, t.c + vertex});
    }
    mesh.instancing = std::make_shared<const Instancing>(instancing);
    const auto two = built("two_level", mesh, "triangle4v");
    CHECK_FALSE(static_cast<const two_level::TwoLevel&>(*two).placed()[1].laid_out);
    CHECK(same_as_flat(mesh, "bvh8", "binned_sah", {"triangle4v"}, 3000) > 3000);
  }
}

TEST_CASE("over instances packets of any size, with any threshold, answer as single rays do") {
  const TriangleMesh mesh = placed_meshes();
  const std::vector<Ray> rays = generic_rays(mesh, 70, 8);
  for (const char* below : {"bvh2", "bvh8", "kdtree"}) {
    const auto two = built("two_level", mesh, "triangle4v", below);
    std::size_t rows = 0;
    for (const KernelRow& row : padded_rows(below, "triangle4v")) {
      if (row.traversal == "single") continue;
      ++rows;
      INFO(name_of(row) << " over " << below);
      const KernelRow& single = *find_kernel("two_level", row.leaf, row.intersector, row.box, "single", row.isa);
      const std::vector<Hit> alone = closest_hit(single, *two, rays);
      const std::vector<std::uint8_t> occluded = any_hit(single, *two, rays);
      for (const std::size_t size : {1u, 2u, 5u, 16u, 17u, 33u, 70u}) {
        for (const unsigned threshold : {TraversalSettings::kOwn, 0u, 1u, 4u, 16u}) {
          const std::span part(rays.data(), size);
          CHECK(same_bits(closest_hit(row, *two, part, {.hybrid_threshold = threshold}), std::span(alone).first(size)));
          const std::vector<std::uint8_t> any = any_hit(row, *two, part, {.hybrid_threshold = threshold});
          CHECK(std::ranges::equal(any, std::span(occluded).first(size)));
          if (!row.traversal.starts_with("hybrid")) break;
        }
      }
    }
    CHECK(rows >= 2 * 9);
  }
}

TEST_CASE("rays of a packet that are the same share each visit, the top's and those in instances") {
  const TriangleMesh mesh = placed_meshes();
  for (const Ray& ray : generic_rays(mesh, 12, 10)) {
    for (const KernelRow& row : padded_rows("bvh8", "triangle4v")) {
      if (row.traversal != "packet64") continue;
      INFO(name_of(row));
      const auto two = built("two_level", mesh, row.leaf);
      const KernelRow& single = *find_kernel("two_level", row.leaf, row.intersector, row.box, "single", row.isa);
      for (const bool any : {false, true}) {
        Counters alone, together;
        const std::vector<Ray> one{ray}, many(64, ray);
        if (any) {
          (void)any_hit(single, *two, one, {}, &alone), (void)any_hit(row, *two, many, {}, &together);
        } else {
          (void)closest_hit(single, *two, one, {}, &alone), (void)closest_hit(row, *two, many, {}, &together);
        }
        CHECK(64 * together.nodes_shared == 63 * together.nodes);
        CHECK(64 * together.leaves_shared == 63 * together.leaves);
        CHECK(together.leaves >= alone.leaves);
        if (any) {  // closest hit may take boxes that a ray begins in in another order
          CHECK(together.nodes == 64 * alone.nodes);
          CHECK(together.leaves == 64 * alone.leaves);
          CHECK(together.triangles == 64 * alone.triangles);
        }
        CHECK(together.rays_in_packets == 64);
        CHECK(together.packets >= 1);
      }
    }
  }
}

TEST_CASE("a forest: in every workload no wrong answer and the flat mesh's, bit for bit; prototypes held once") {
  const Scene scene = load_scene(parse_scene_word("forest:60000"));
  REQUIRE(scene.mesh.instancing);
  CHECK(scene.mesh.instancing->instances.size() > 900);
  const Oracle oracle(scene.mesh);
  const View view{64, 64, 1};
  const Workload primary = make_primary(scene, view);
  std::vector<Hit> primary_hits;
  for (const ExactHit& h : oracle.closest_hit(primary.batch())) primary_hits.push_back(h.hit);
  const auto two = built("two_level", scene.mesh, "triangle4v"), flat = built("bvh8", scene.mesh, "triangle4v");
  for (std::string_view name : workload_names()) {
    const Workload workload = make_workload(name, scene, view, primary.batch(), primary_hits);
    const bool any = workload.query == Query::any_hit;
    const auto any_truth = any ? oracle.any_hit(workload.rays) : std::vector<std::uint8_t>{};
    const auto truth = any ? std::vector<ExactHit>{} : oracle.closest_hit(workload.rays);
    const std::vector<KernelRow> rows = padded_rows("bvh8", "triangle4v");
    REQUIRE(rows.size() >= 2 * 10);
    for (const KernelRow& row : rows) {
      if (row.traversal == "auto" && row.isa == Isa::sse && (name == "primary" || name == "random")) {
        Counters counters;
        (void)closest_hit(row, *two, workload.rays, {}, &counters);
        CHECK(counters.rays_in_packets == (name == "primary" ? workload.rays.size() : 0));
      }
      const KernelRow& of_flat = *find_kernel("bvh8", row.leaf, row.intersector, row.box, row.traversal, row.isa);
      CHECK(same_bits(closest_hit(row, *two, workload.rays), closest_hit(of_flat, *flat, workload.rays)));
      CHECK(any_hit(row, *two, workload.rays) == any_hit(of_flat, *flat, workload.rays));
      const AnswerCheck check =
          any ? oracle.check_any_hit(workload.rays, any_truth, any_hit(row, *two, workload.rays))
              : oracle.check_closest_hit(workload.rays, truth, closest_hit(row, *two, workload.rays));
      INFO(name << ": " << name_of(row));
      CAPTURE(check.missed_hits, check.false_hits, check.wrong_surface, check.rays);
      CHECK(check.wrong_answers() == 0);
    }
  }
  CHECK(two->bytes() * 10 < flat->bytes());
  for (const two_level::Placed& instance : static_cast<const two_level::TwoLevel&>(*two).placed())
    REQUIRE(instance.laid_out);
  const StructureStatistics statistics = compute_statistics(*two, scene.mesh, {}, false);
  CHECK(statistics.available);
  CHECK(statistics.references == scene.mesh.size());
}

TEST_CASE("a build's report counts the instances: their memory and their time") {
  const Scene scene = load_scene(parse_scene_word("forest:20000"));
  BuildSettings settings;
  BuildReport report;
  const auto two = build_structure("two_level", scene.mesh, settings, report);
  CHECK(report.peak_bytes >= two->bytes());
  std::vector<std::string> last;
  for (const auto& phase : report.phases) last.push_back(phase.first);
  REQUIRE(last.size() >= 2);
  CHECK(std::vector(last.end() - 2, last.end()) == std::vector<std::string>{"instances", "top"});
}

TEST_CASE("instances in one place: the lowest id wins, in whatever order they are visited") {
  Layout layout;
  const std::uint32_t ball = layout.add_part(sphere(6));
  for (int i = 0; i < 5; ++i) layout.place(ball, map_of(0.4, 1.3, {1, 2, 3}), 0);
  const TriangleMesh mesh = layout.take(true);
  const std::vector<Ray> rays = generic_rays(mesh, 500, 9);
  for (const KernelRow& row : rows_over("bvh8")) {
    INFO(name_of(row));
    const auto two = built("two_level", mesh, row.leaf);
    std::size_t found = 0;
    for (const Hit& hit : closest_hit(row, *two, rays)) {
      if (hit.is_hit()) REQUIRE(hit.primitive < mesh.size() / 5);
      found += hit.is_hit();
    }
    CHECK(found > 50);
  }
}

TEST_CASE("instances without triangles take no part") {
  Instancing instancing;
  instancing.prototypes = {TriangleMesh{}, sphere(4), TriangleMesh{}};
  const TriangleMesh& ball = instancing.prototypes[1];
  for (const std::size_t full : {0u, 1u, 6u}) {
    TriangleMesh mesh;
    instancing.instances.clear();
    for (std::size_t i = 0; i < full; ++i) {
      const AffineMap map = map_of(0.0, 1.0, {3.0f * float(i), 0, 0});
      const auto first = std::uint32_t(mesh.vertices.size()), triangle = std::uint32_t(mesh.size());
      for (const std::uint32_t empty : {0u, 2u, 0u}) instancing.instances.push_back({empty, triangle, map});
      instancing.instances.push_back({1, triangle, map});
      for (const Vec3f& v : ball.vertices) mesh.vertices.push_back(transform_point(map, v));
      for (const Triangle& t : ball.triangles) mesh.triangles.push_back({t.a + first, t.b + first, t.c + first});
    }
    for (int i = 0; i < 9; ++i)
      instancing.instances.push_back({0, std::uint32_t(mesh.size()), map_of(0, 1, {1, 1, 1})});
    mesh.instancing = std::make_shared<const Instancing>(instancing);
    for (const char* builder : {"binned_sah", "sweep_sah", "morton", "ploc"}) {
      INFO(builder << " " << full);
      const auto two = built("two_level", mesh, "triangle4v", "bvh8", builder);
      CHECK(compute_statistics(*two, mesh, {}, false).references == mesh.size());
      const KernelRow& row = *find_kernel("two_level", "triangle4v", "watertight", "padded", "single", Isa::sse);
      for (std::size_t i = 0; i < full; ++i) {
        const std::vector<Ray> ray{{{3.0f * float(i), 0, -3}, 0, {0.01f, 0.02f, 1}, kInfinity}};
        const Hit hit = closest_hit(row, *two, ray)[0];
        REQUIRE(hit.is_hit());
        CHECK(hit.primitive / ball.size() == i);
      }
    }
  }
}

TEST_CASE("a map that takes its prototype's box beyond float is refused") {
  // x' = s x - s y: of vertices with x = y the image is small, of their box it is not.
  for (const double s : {1e37, 1e39, 1e45, 1e300}) {
    INFO(s);
    Instancing instancing;
    TriangleMesh one, mesh;
    one.vertices = {{0, 0, 0}, {1, 1, 0}, {0, 0, 1}}, one.triangles = {{0, 1, 2}};
    instancing.prototypes = {one};
    for (std::uint32_t i = 0; i < 2; ++i) {
      instancing.instances.push_back({0, i, {{{s, -s, 0, 0}, {1, 1, 0, double(i)}, {0, 0, 1, 0}}}});
      for (const Vec3f& v : one.vertices) mesh.vertices.push_back(transform_point(instancing.instances[i].to_world, v));
      mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    mesh.instancing = std::make_shared<const Instancing>(instancing);
    if (s < 1e38) {
      CHECK_NOTHROW(built("two_level", mesh, "triangle4v"));
    } else {
      CHECK_THAT(error_of([&] { (void)built("two_level", mesh, "triangle4v"); }), Catch::Contains("is beyond float"));
    }
  }
}

TEST_CASE("closed meshes stay closed under transforms") {
  Layout layout;
  const std::uint32_t ball = layout.add_part(sphere(24));
  layout.place(ball, map_of(0.9, 3.0, {50, -20, 10}), 0);
  const TriangleMesh mesh = layout.take(true);
  const std::vector<Ray> rays = aimed_rays(mesh, {50.3f, -20.2f, 10.1f}, 4000, 5);
  for (const KernelRow& row : rows_over("bvh8")) {
    if (row.intersector != "watertight" || row.box != "padded") continue;
    INFO(name_of(row));
    const auto two = built("two_level", mesh, row.leaf);
    std::size_t cracks = 0;
    for (const Hit& hit : closest_hit(row, *two, rays)) cracks += !hit.is_hit();
    for (const std::uint8_t occluded : any_hit(row, *two, rays)) cracks += !occluded;
    CHECK(cracks == 0);
  }
}

TEST_CASE("primitive ids agree with the flat mesh when layout flattens triangles of an instance") {
  const Folder folder;
  // The second triangle is so thin that it has no area left 1e6 away, where it is dropped; near the origin it stays.
  folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 1e-3 0\nv 1 0 1e-3\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 6\n");
  const Scene scene = load_file(folder.write(
      "s.yaml",
      "meshes: [a.obj]\ninstances: [{mesh: a, transforms: [{translate: [0, 1e6, 0]}, {translate: [5, 0, 0]}, "
      "{translate: [9, 1e6, 0]}, {scale: [1, 1, 1e-5]}]}]\n"));
  REQUIRE(scene.mesh.instancing);
  const Instancing& instancing = *scene.mesh.instancing;
  CHECK(scene.report.degenerate == 2);
  CHECK(scene.mesh.size() == 10);
  REQUIRE(instancing.instances.size() == 4);
  CHECK(instancing.instances[0].prototype == instancing.instances[2].prototype);
  CHECK(instancing.instances[0].prototype != instancing.instances[1].prototype);
  std::uint32_t next = 0;
  for (const Instance& instance : instancing.instances) {
    CHECK(instance.first_primitive == next);
    const TriangleMesh& prototype = instancing.prototypes[instance.prototype];
    for (std::size_t i = 0; i < prototype.size(); ++i) {
      for (std::size_t k = 0; k < 3; ++k)
        CHECK(transform_point(instance.to_world, prototype.corners(i)[k]) == scene.mesh.corners(next + i)[k]);
    }
    next += std::uint32_t(prototype.size());
  }
  CHECK(next == scene.mesh.size());
}

TEST_CASE("what cannot stand below is refused in one line") {
  const TriangleMesh mesh = random_triangles(20, 0.3f, 1);
  const struct {
    std::string below, builder, leaf, message;
  } cases[] = {
      {"two_level", "binned_sah", "triangle4",
       "two_level over two_level: two_level stands above other structures, not below one"},
      {"bvh4_motion", "binned_sah", "triangle4i", "two_level over bvh4_motion: bvh4_motion is for moving scenes"},
      {"bvh88", "binned_sah", "triangle4", "below: unknown structure 'bvh88'; did you mean 'bvh8'? (valid: "},
      {"brute_force", "binned_sah", "triangle4", "two_level over brute_force: brute_force has no builder binned_sah"},
  };
  for (const auto& c : cases) {
    INFO(c.below);
    CHECK_THAT(error_of([&] { (void)built("two_level", mesh, c.leaf, c.below, c.builder); }),
               Catch::Contains(c.message));
  }
}
