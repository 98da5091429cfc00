// `verify`: promises, hard rays, and the search by properties. The command itself is in test_verify_command.cpp.
#include <tbb/task_arena.h>

#include <filesystem>
#include <fstream>
#include <limits>
#include <set>
#include <sstream>

#include "core/error.h"
#include "core/exact/exact_predicate.h"
#include "experiments/case_file.h"
#include "experiments/verification.h"
#include "experiments/verify_reduce.h"
#include "intersectors/promises.h"
#include "oracle/hard_rays.h"
#include "oracle/random_cases.h"
#include "scenes/generators/generators.h"
#include "structures/accel.h"
#include "tests/catch.h"
#include "tests/small_meshes.h"

using namespace arboretum;

namespace {

const std::filesystem::path kSource = ARBORETUM_SOURCE_DIR;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// Rows of our structures on ISAs that run here, that promise something: single rays, the structures' first builder.
std::vector<VerifiedCell> promising_cells(const Registry& registry) {
  std::vector<VerifiedCell> cells;
  for (const KernelRow& row : registry.kernels) {
    const Promise promise = promise_of(row.structure, row.intersector, row.box);
    const StructureInfo& info = registry.structure(row.structure)->info;
    if (!promise.any() || !registry.has(row.isa) || info.needs_motion) continue;
    if (row.leaf != registry.default_leaf(row.structure, row.intersector, row.isa)) continue;
    // test_kernels holds the modes of all to their single rays
    if (row.traversal != "single" && row.structure != "bvh8" && row.structure != "kdtree") continue;
    Cell cell;
    cell.structure = row.structure, cell.builder = info.builders.front(), cell.leaf = row.leaf,
    cell.intersector = row.intersector;
    cell.box = row.box, cell.traversal = row.traversal, cell.isa = row.isa, cell.kernel = &row;
    cells.push_back({cell, promise, {}, {}});
  }
  return cells;
}

std::vector<VerifiedCell> only(std::vector<VerifiedCell> cells, std::string_view structure,
                               std::string_view intersector) {
  std::erase_if(
      cells, [&](const VerifiedCell& c) { return c.cell.structure != structure || c.cell.intersector != intersector; });
  return cells;
}

/// Fails with a literal case for each cell that breaks its promise.
void check_promises(std::vector<VerifiedCell>& cells, const Registry& registry, const TriangleMesh& mesh,
                    const HardRays& rays, const Company* company = nullptr) {
  tbb::task_arena(1).execute([&] {  // too little work to share out
    const Oracle oracle(mesh);
    StructureShelf shelf(mesh, registry, 1);
    verify_all(cells, 0, shelf, {mesh, oracle, rays, oracle.closest_hit(rays.batch())}, company);
  });
  for (VerifiedCell& c : cells) {
    const VerifyTally sum = c.sum();
    c.tallies.clear();
    if (sum.broken == 0) continue;
    const auto part = reduce(c, registry, mesh, sum.first);
    FAIL_CHECK(c.cell.name() << ": " << sum.first.what << "\n"
                             << (part ? case_json("found", sum.first.what, *part, sum.first.given) : ""));
  }
}

}  // namespace

TEST_CASE("every intersector and box test of the table has a line in the promises, and the docs have the same table") {
  std::ifstream file(kSource / "docs/numerics.md");
  std::stringstream text;
  text << file.rdbuf();
  const std::string docs = text.str();
  for (std::string_view intersector : axis_values().intersectors) {
    if (intersector == "-" || intersector == "embree") continue;
    const auto* line = std::ranges::find(kIntersectorPromises, intersector, &IntersectorPromise::intersector);
    INFO(intersector);
    const bool named = line != std::end(kIntersectorPromises);
    const bool embree_only = std::ranges::all_of(kernel_table(), [&](const KernelRow& row) {
      return row.intersector != intersector || row.structure == "embree";
    });
    CHECK((named || embree_only));
  }
  for (const IntersectorPromise& p : kIntersectorPromises) {
    const std::string row = "| `" + std::string(p.intersector) + "` | " +
                            to_words(promise_of("", p.intersector, "padded")) + " | " + std::string(p.remark) + " |";
    INFO(row);
    CHECK(docs.find(row) != std::string::npos);
  }
  CHECK_FALSE(promise_of("embree", "watertight", "padded").any());
  CHECK_FALSE(promise_of("bvh8", "watertight", "fast").any());
  CHECK(promise_of("two_level", "watertight", "padded").any());
  CHECK(promise_of("bvh8", "watertight", "padded").any());
  CHECK(promise_of("bvh8", "exact", "fast").coverage == Coverage::none);
  CHECK(box_called_for("watertight") == "padded");
  CHECK(box_called_for("moller_trumbore") == "fast");
}

TEST_CASE("hard rays are of their kinds, and the same in any batch") {
  const TriangleMesh ball = generate_sphere(500, 1).mesh;
  const HardRayMaker maker(ball);
  CHECK_FALSE(maker.has(HardKind::border));
  TriangleMesh one;
  add_triangle(one, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
  CHECK(HardRayMaker(one).has(HardKind::border));
  CHECK_FALSE(HardRayMaker(one).has(HardKind::edge));

  std::vector<HardKind> kinds;
  for (std::size_t k = 0; k < kMadeKinds; ++k)
    if (maker.has(static_cast<HardKind>(k))) kinds.push_back(static_cast<HardKind>(k));
  const HardRays all = maker.make(7, 0, 4000, kinds), part = maker.make(7, 1000, 500, kinds),
                 other = maker.make(8, 0, 4000, kinds);
  CHECK(std::memcmp(part.rays.data(), all.rays.data() + 1000, 500 * sizeof(Ray)) == 0);
  CHECK(std::memcmp(other.rays.data(), all.rays.data(), 4000 * sizeof(Ray)) != 0);

  const Oracle oracle(ball);
  const std::vector<ExactHit> truth = oracle.closest_hit(all.batch());
  std::array<std::size_t, kHardKindNames.size()> hits{}, ties{}, rays{};
  for (std::size_t i = 0; i < truth.size(); ++i) {
    const auto k = static_cast<std::size_t>(all.kinds[i]);
    ++rays[k], hits[k] += truth[i].hit.is_hit(), ties[k] += truth[i].tie;
    if (all.kinds[i] == HardKind::invalid) CHECK_FALSE(is_valid(all.rays[i]));
    if (all.kinds[i] == HardKind::surface) CHECK(all.sources[i] < ball.size());
    if (all.kinds[i] == HardKind::axis) {
      const Vec3f d = all.rays[i].direction;
      CHECK((d.x != 0) + (d.y != 0) + (d.z != 0) == 1);
    }
  }
  const auto share = [&](HardKind k) {
    return double(hits[static_cast<std::size_t>(k)]) / double(rays[static_cast<std::size_t>(k)]);
  };
  CHECK(share(HardKind::interior) > 0.99);
  CHECK(share(HardKind::edge) > 0.7);
  CHECK(share(HardKind::vertex) > 0.6);
  CHECK(share(HardKind::axis) > 0.9);
  CHECK(share(HardKind::invalid) == 0.0);
  // Some pass exactly through a vertex or an edge.
  CHECK(ties[static_cast<std::size_t>(HardKind::vertex)] > rays[static_cast<std::size_t>(HardKind::vertex)] / 20);
  CHECK(ties[static_cast<std::size_t>(HardKind::axis)] > rays[static_cast<std::size_t>(HardKind::axis)] / 20);
}

TEST_CASE("the oracle's tree leaves out no triangle that hard rays meet") {
  const std::array kinds{HardKind::vertex, HardKind::edge, HardKind::interior, HardKind::grazing, HardKind::axis,
                         HardKind::plane,  HardKind::far,  HardKind::surface,  HardKind::interval};
  for (const auto& [offset, exponent] : {std::pair{0.0, 0}, {1e5, 0}, {3.0, 60}, {0.0, -60}}) {
    INFO("offset " << offset << ", scaled by 2^" << exponent);
    const TriangleMesh mesh = moved_and_scaled(generate_sphere(200, 1).mesh, offset, exponent);
    const HardRays rays = HardRayMaker(mesh).make(2, 0, 1800, kinds);
    const std::vector<ExactHit> truth = Oracle(mesh).closest_hit(rays.batch());
    for (std::size_t i = 0; i < truth.size(); ++i) {
      if (!is_valid(rays.rays[i])) continue;
      ExactPredicate predicate(rays.rays[i]);
      std::uint32_t nearest = kNoPrimitive;
      for (std::uint32_t id = 0; id < mesh.size(); ++id) {
        Enclosure t;
        if (!predicate.meets(mesh.corners(id), t)) continue;
        if (nearest == kNoPrimitive || predicate.compare_t(mesh.corners(id), mesh.corners(nearest)) < 0) nearest = id;
      }
      INFO("ray " << i << " of kind " << to_string(rays.kinds[i]));
      REQUIRE(truth[i].hit.primitive == nearest);
    }
  }
}

TEST_CASE("the histogram's quantiles are within 4.5 %, its maximum exact") {
  ErrorHistogram h, rest;
  for (int i = 1; i <= 1000; ++i) (i % 2 ? h : rest).add(i * 0.01);
  h += rest;
  CHECK(h.count() == 1000);
  for (double p : {0.01, 0.5, 0.99}) {
    CHECK(h.quantile(p) >= 10 * p * (1 - 1e-12));
    CHECK(h.quantile(p) <= 10 * p * 1.045);
  }
  CHECK(h.max() == 10.0);
  ErrorHistogram exact;
  exact.add(0.0);
  CHECK(exact.quantile(0.99) == 0.0);
}

TEST_CASE("the histogram counts beyond 2^32 rays") {
  ErrorHistogram h;
  h.add(1.0), h.add(4.0), h.add(4.0);
  for (int i = 0; i < 33; ++i) h += ErrorHistogram(h);
  CHECK(h.count() == std::uint64_t{3} << 33);
  CHECK(h.quantile(0.3) >= 1.0);
  CHECK(h.quantile(0.3) <= 1.045);
  CHECK(h.quantile(0.9) == 4.0);
  ErrorHistogram sum;
  sum.add(0.0), sum += h;
  CHECK(sum.quantile(1.0) == 4.0);
  CHECK(ErrorHistogram().quantile(0.5) == 0.0);
}

TEST_CASE("cells keep their promises on spheres, fans and boxes, near and far from the origin") {
  const Registry registry = this_registry();
  std::vector<VerifiedCell> cells = promising_cells(registry);
  REQUIRE(cells.size() > 10);
  const std::array kinds{HardKind::vertex,   HardKind::edge,    HardKind::interior, HardKind::axis,
                         HardKind::plane,    HardKind::grazing, HardKind::surface,  HardKind::far,
                         HardKind::interval, HardKind::invalid};
  const struct {
    const char* generator;
    std::size_t triangles;
    double offset;
    int exponent;
  } scenes[] = {{"sphere", 300, 0, 0}, {"sphere", 300, 1e4, 0}, {"fan", 64, 0, 0},
                {"fan", 256, 100, 0},  {"sphere", 300, 0, -20}, {"fan", 64, 1e5, 10}};
  for (const auto& s : scenes) {
    INFO(s.generator << " of " << s.triangles << ", offset " << s.offset << ", scaled by 2^" << s.exponent);
    const TriangleMesh mesh = moved_and_scaled(generate_scene(s.generator, s.triangles, 1).mesh, s.offset, s.exponent);
    check_promises(cells, registry, mesh, HardRayMaker(mesh).make(3, 0, 400, kinds));
  }
}

TEST_CASE("a search through random meshes and mutated hard cases finds no broken promise") {
  // By hand at any length: arboretum verify random --rays N; arboretum verify tests/hard_cases.json --rays N.
  const Registry registry = this_registry();
  std::vector<VerifiedCell> cells = promising_cells(registry);
  for (std::uint64_t i = 0; i < 100; ++i) {
    INFO("random subject " << i << " of seed 11");
    const RandomSubject subject = random_subject(11, i, 32);
    check_promises(cells, registry, subject.mesh, subject.rays);
  }
  const std::vector<VerifyCase> cases = read_case_file(kSource / "tests/hard_cases.json");
  for (std::uint64_t i = 0; i < cases.size(); ++i) {
    if (cases[i].mesh.size() > 100) continue;
    INFO("a mutation of " << cases[i].id);
    const RandomSubject subject = mutated_subject(cases[i].mesh, cases[i].ray, 5, i, 16);
    check_promises(cells, registry, subject.mesh, subject.rays);
  }
}

TEST_CASE("what the search once found stays mended") {
  const Registry registry = this_registry();
  std::vector<VerifiedCell> cells = promising_cells(registry);
  for (const VerifyCase& c : read_case_file(kSource / "tests/found_cases.json")) {
    INFO(c.id << ": " << c.why);
    HardRays rays;
    rays.rays = {c.ray}, rays.kinds = {HardKind::given}, rays.sources = {kNoPrimitive};
    const Company company{in_company(c.ray, 1, 64, 11), 11};
    check_promises(cells, registry, c.mesh, rays, &company);
  }
}

namespace {

/// What verify finds of the cell, by kind of ray, on rays aimed at the mesh.
std::vector<VerifyTally> tallies_of(const VerifiedCell& verified, const Registry& registry, const TriangleMesh& mesh,
                                    std::size_t count, std::span<const HardKind> kinds) {
  const HardRays rays = HardRayMaker(mesh).make(1, 0, count, kinds);
  const Oracle oracle(mesh);
  StructureShelf shelf(mesh, registry, 1);
  std::vector<Hit> hits;
  return verify_cell(verified.cell, shelf.get(verified.cell), {mesh, oracle, rays, oracle.closest_hit(rays.batch())},
                     hits, {});
}

}  // namespace

TEST_CASE("structures are held as long as cells are expected to take them, and no longer") {
  const Registry registry = this_registry();
  const std::vector<VerifiedCell> cells = promising_cells(registry);
  const auto cell_of = [&](std::string_view structure) -> const Cell& {
    return std::ranges::find_if(cells, [&](const VerifiedCell& c) { return c.cell.structure == structure; })->cell;
  };
  const Cell &first = cell_of("bvh4"), &second = cell_of("bvh8"), &third = cell_of("kdtree");
  const TriangleMesh mesh = generate_sphere(300, 1).mesh;
  StructureShelf kept(mesh, registry, 1);
  for (const Cell* cell : {&first, &second, &third}) (void)kept.get(*cell);
  CHECK(kept.size() == 3);

  StructureShelf shelf(mesh, registry, 1);
  shelf.expect(first, 2), shelf.expect(second, 1), shelf.expect(first, 1), shelf.expect(third, 1);
  const Accel* held = &shelf.get(first);
  (void)shelf.get(second);
  CHECK(shelf.size() == 2);  // the first is expected twice more
  CHECK(&shelf.get(first) == held);
  CHECK(shelf.size() == 1);
  CHECK(&shelf.get(first) == held);
  (void)shelf.get(third);
  CHECK(shelf.size() == 1);
  (void)shelf.get(first);  // unexpected: built again
  CHECK(shelf.size() == 1);
}

TEST_CASE("a kernel that leaks is told to leak, and a promise that it breaks is shown as a small case") {
  const Registry registry = this_registry();
  std::vector<VerifiedCell> cells = only(promising_cells(registry), "bvh8", "watertight");
  REQUIRE_FALSE(cells.empty());
  // A kernel of moller_trumbore that calls itself watertight.
  const KernelRow* leaky = nullptr;
  for (const KernelRow& row : registry.kernels)
    if (row.structure == "bvh8" && row.intersector == "moller_trumbore" && row.isa == cells[0].cell.isa &&
        row.traversal == "single")
      leaky = &row;
  REQUIRE(leaky);
  VerifiedCell& liar = cells[0];
  liar.cell.kernel = leaky, liar.cell.leaf = leaky->leaf;
  const TriangleMesh mesh = generate_sphere(300, 1).mesh;
  const std::array kinds{HardKind::vertex, HardKind::edge};
  const auto tallies = tallies_of(liar, registry, mesh, 4000, kinds);
  const VerifyTally& edge = tallies[static_cast<std::size_t>(HardKind::edge)];
  CHECK(edge.rays == 2000);
  CHECK(edge.cracks > 20);
  CHECK(edge.broken >= edge.cracks);
  REQUIRE_FALSE(edge.first.what.empty());
  const auto part = reduce(liar, registry, mesh, edge.first);
  REQUIRE(part);
  CHECK(part->size() <= 4);
  CHECK_FALSE(case_json("x", "y", *part, edge.first.given).empty());
}

TEST_CASE("a kernel that writes no answer is wrong on every ray") {
  const Registry registry = this_registry();
  std::vector<VerifiedCell> cells = only(promising_cells(registry), "bvh8", "exact");
  std::erase_if(cells, [](const VerifiedCell& c) { return c.cell.box != "padded"; });
  REQUIRE_FALSE(cells.empty());
  KernelRow silent = *cells[0].cell.kernel;
  silent.timed.any_hit = [](const Accel&, const KernelRow&, RayBatch, std::span<std::uint8_t>, Counters*) {};
  cells[0].cell.kernel = &silent;
  const TriangleMesh mesh = generate_sphere(300, 1).mesh;
  const std::array kinds{HardKind::interior, HardKind::far};
  VerifyTally sum;
  for (const VerifyTally& t : tallies_of(cells[0], registry, mesh, 200, kinds)) sum += t;
  CHECK(sum.rays == 200);
  CHECK(sum.any_missed + sum.any_false == 200);
  CHECK(sum.broken == 200);
}

namespace {

/// The kernel that a liar stands for: lambdas without captures call it.
const KernelRow* honest = nullptr;

/// The first of the cells, with these functions in the place of its own.
VerifiedCell lying(VerifiedCell cell, KernelRow& row, ClosestHitFunction closest, AnyHitFunction any = nullptr) {
  honest = cell.cell.kernel;
  row = *honest;
  row.timed.closest_hit = closest;
  if (any) row.timed.any_hit = any;
  cell.cell.kernel = &row;
  return cell;
}

VerifiedCell padded_cell(const Registry& registry, std::string_view intersector, std::string_view traversal) {
  std::vector<VerifiedCell> cells = only(promising_cells(registry), "bvh8", intersector);
  std::erase_if(cells, [&](const VerifiedCell& c) { return c.cell.box != "padded" || c.cell.traversal != traversal; });
  REQUIRE_FALSE(cells.empty());
  return cells.front();
}

/// What breaks of the promise on one ray; empty: nothing. `company` as verify_all() has it.
std::string breach_on(const VerifiedCell& cell, const Registry& registry, const TriangleMesh& mesh, const Ray& ray,
                      const Company* company = nullptr) {
  HardRays rays;
  rays.rays = {ray}, rays.kinds = {HardKind::given}, rays.sources = {kNoPrimitive};
  const Oracle oracle(mesh);
  StructureShelf shelf(mesh, registry, 1);
  std::vector<VerifiedCell> cells{cell};
  verify_all(cells, 0, shelf, {mesh, oracle, rays, oracle.closest_hit(rays.batch())}, company);
  const VerifyTally sum = cells[0].sum();
  CHECK(sum.rays == 1);
  CHECK((sum.broken > 0) == !sum.first.what.empty());
  return sum.first.what;
}

}  // namespace

TEST_CASE("exact is held to everything where t is below 2^127, u and v among it, and beyond to nothing") {
  const Registry registry = this_registry();
  const VerifiedCell exact = padded_cell(registry, "exact", "single");
  TriangleMesh mesh;
  add_triangle(mesh, {-1, -1, 1}, {1, -1, 1}, {0, 1, 1});
  KernelRow row;
  const VerifiedCell blind =
      lying(exact, row, [](const Accel&, const KernelRow&, RayBatch, std::span<Hit> hits, Counters*) { hits[0] = {}; });
  const auto along = [](float z) { return Ray{{0, 0, 0}, 0, {0, 0, z}, kInfinity}; };
  for (const float z : {1.0f, 0x1.000004p-127f}) {
    INFO("direction " << z);
    CHECK(breach_on(exact, registry, mesh, along(z)).empty());
    CHECK(breach_on(blind, registry, mesh, along(z)) == "an exact hit is missed");
  }
  for (const float z : {0x1p-127f, 0x1p-128f}) {  // t of 2^127, and beyond float
    INFO("direction " << z);
    CHECK(breach_on(blind, registry, mesh, along(z)).empty());
  }
  KernelRow off;
  const auto turned =
      lying(exact, off, [](const Accel& a, const KernelRow&, RayBatch r, std::span<Hit> hits, Counters*) {
        honest->closest_hit(a, r, hits);
        hits[0].v += 0x1p-22f;
      });
  CHECK(breach_on(turned, registry, mesh, along(1)) == "u or v is off by more than an ulp of 1");
}

TEST_CASE("tests in double are held to half an ulp of t and its conditioning") {
  const Registry registry = this_registry();
  for (const char* intersector : {"moller_trumbore_double", "pluecker_double", "watertight_refined"}) {
    INFO(intersector);
    const VerifiedCell cell = padded_cell(registry, intersector, "single");
    CHECK(cell.promise.t_ulp == 0.5);
    KernelRow row;
    const VerifiedCell liar =
        lying(cell, row, [](const Accel& a, const KernelRow&, RayBatch r, std::span<Hit> hits, Counters*) {
          honest->closest_hit(a, r, hits);
          for (Hit& hit : hits) hit.t = std::nextafter(hit.t, 0.0f);
        });
    TriangleMesh mesh;
    add_triangle(mesh, {-1, -1, 1}, {1, -1, 1}, {0, 1, 1.5f});
    const Ray plain{{0, 0, 0}, 0, {0.1f, 0.2f, 3}, kInfinity};
    CHECK(breach_on(cell, registry, mesh, plain).empty());
    CHECK(breach_on(liar, registry, mesh, plain) == "t is off by more than is promised");
    // In the plane of the triangle but for 2^-40 of its length: t is not known to an ulp in doubles.
    TriangleMesh edge_on;
    add_triangle(edge_on, {1, -0x1p-40f, -1}, {3, 0x1p-40f, -1}, {2, 0, 1});
    const Ray grazing{{0, 0, 0}, 0, {1, 0, 0}, kInfinity};
    CHECK(breach_on(liar, registry, edge_on, grazing).empty());
  }
}

TEST_CASE("a ray is held to its answer among others, too") {
  const Registry registry = this_registry();
  TriangleMesh mesh;
  add_triangle(mesh, {-1, -1, 1}, {1, -1, 1}, {0, 1, 1});
  const Ray ray{{0, 0, 0}, 0, {0.1f, 0.2f, 1}, kInfinity};
  const Company company{in_company(ray, 1, 64, 37), 37};
  CHECK(std::memcmp(&company.rays[37], &ray, sizeof ray) == 0);
  CHECK(std::ranges::count_if(company.rays, [](const Ray& r) { return !is_valid(r); }) > 5);
  CHECK(std::ranges::count_if(company.rays, [](const Ray& r) { return is_valid(r); }) > 30);
  CHECK(std::memcmp(in_company(ray, 1, 64, 37).data(), company.rays.data(), 64 * sizeof(Ray)) == 0);
  const VerifiedCell cell = padded_cell(registry, "exact", "packet64");
  CHECK(breach_on(cell, registry, mesh, ray, &company).empty());
  KernelRow row;
  const VerifiedCell liar =
      lying(cell, row, [](const Accel& a, const KernelRow&, RayBatch r, std::span<Hit> hits, Counters*) {
        honest->closest_hit(a, r, hits);
        if (hits.size() > 1) hits[37].t = 2;
      });
  CHECK(breach_on(liar, registry, mesh, ray).empty());
  CHECK(breach_on(liar, registry, mesh, ray, &company) == "t is not the exact t rounded, among other rays");
}

TEST_CASE("pluecker keeps its promise far from the origin, where rays aimed at edges pass vertices by chance") {
  const Registry registry = this_registry();
  std::vector<VerifiedCell> cells = only(promising_cells(registry), "bvh8", "pluecker");
  std::erase_if(cells, [](const VerifiedCell& c) { return c.cell.traversal != "single"; });
  REQUIRE_FALSE(cells.empty());
  const std::array kinds{HardKind::edge, HardKind::interior, HardKind::axis, HardKind::plane, HardKind::far};
  for (const double offset : {1e4, 1e5}) {
    for (const std::uint64_t seed : {2, 3}) {
      INFO("offset " << offset << ", seed " << seed);
      const TriangleMesh mesh = moved_and_scaled(generate_sphere(500, 1).mesh, offset, 0);
      check_promises(cells, registry, mesh, HardRayMaker(mesh).make(seed, 0, 8000, kinds));
    }
  }
}
