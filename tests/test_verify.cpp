// `verify`: promises, hard rays, the search by properties, and the command's verdicts.
#include <tbb/task_arena.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "core/error.h"
#include "core/exact/exact_predicate.h"
#include "experiments/case_file.h"
#include "experiments/commands.h"
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

/// Rows of our structures on ISAs that run here, that promise something: single rays, the structures' first builder.
std::vector<VerifiedCell> promising_cells(const Registry& registry) {
  std::vector<VerifiedCell> cells;
  for (const KernelRow& row : registry.kernels) {
    const Promise promise = promise_of(row.structure, row.intersector, row.box);
    const StructureInfo& info = registry.structure(row.structure)->info;
    if (!promise.any() || !registry.has(row.isa) || info.needs_motion) continue;
    if (row.leaf != registry.default_leaf(row.structure, row.intersector, row.isa)) continue;
    if (row.traversal != "single" && row.structure != "bvh8" && row.structure != "kdtree") continue;  // test_kernels holds the modes of all to their single rays
    Cell cell;
    cell.structure = row.structure, cell.builder = info.builders.front(), cell.leaf = row.leaf, cell.intersector = row.intersector;
    cell.box = row.box, cell.traversal = row.traversal, cell.isa = row.isa, cell.kernel = &row;
    cells.push_back({cell, promise, {}, {}});
  }
  return cells;
}

std::vector<VerifiedCell> only(std::vector<VerifiedCell> cells, std::string_view structure, std::string_view intersector) {
  std::erase_if(cells, [&](const VerifiedCell& c) { return c.cell.structure != structure || c.cell.intersector != intersector; });
  return cells;
}

/// Fails with a literal case for each cell that breaks its promise.
void check_promises(std::vector<VerifiedCell>& cells, const Registry& registry, const TriangleMesh& mesh, const HardRays& rays) {
  tbb::task_arena(1).execute([&] {  // too little work to share out
    const Oracle oracle(mesh);
    StructureShelf shelf(mesh, registry, 1);
    verify_all(cells, 0, shelf, {mesh, oracle, rays, oracle.closest_hit(rays.batch())});
  });
  for (VerifiedCell& c : cells) {
    const VerifyTally sum = c.sum();
    c.tallies.clear();
    if (sum.broken == 0) continue;
    const auto part = reduce(c, registry, mesh, sum.first);
    FAIL_CHECK(c.cell.name() << ": " << sum.first.what << "\n" << (part ? case_json("found", sum.first.what, *part, sum.first.given) : ""));
  }
}

struct Outcome {
  int status = 0;
  std::string out, error;
};

/// The program's command, its words on stdout and the error that it throws.
Outcome verify(const VerifyCommand& command) {
  Outcome outcome;
  const auto path = std::filesystem::temp_directory_path() / ("arboretum_verify_" + std::to_string(getpid()));
  std::fflush(stdout);
  const int saved = dup(1);
  REQUIRE(std::freopen(path.c_str(), "w", stdout));
  try {
    outcome.status = static_cast<int>(command_verify(command));
  } catch (const UserError& e) {
    outcome.status = static_cast<int>(ExitStatus::kUsage), outcome.error = e.what();
  }
  std::fflush(stdout);
  dup2(saved, 1);
  close(saved);
  std::stringstream text;
  text << std::ifstream(path).rdbuf();
  outcome.out = text.str();
  std::filesystem::remove(path);
  return outcome;
}

std::string any_isa() {
  // ARBORETUM_ISAS may leave some out of the build.
  for (const KernelRow& row : kernel_table())
    if (is_available(row.isa) && row.structure == "bvh8") return std::string(to_string(row.isa));
  return "scalar";
}

std::filesystem::path written(const std::string& name, const std::string& text) {
  const auto path = std::filesystem::temp_directory_path() / (std::to_string(getpid()) + name);
  std::ofstream(path) << text;
  return path;
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
    const std::string row = "| `" + std::string(p.intersector) + "` | " + to_words(promise_of("", p.intersector, "padded")) + " | " +
                            std::string(p.remark) + " |";
    INFO(row);
    CHECK(docs.find(row) != std::string::npos);
  }
  CHECK_FALSE(promise_of("embree", "watertight", "padded").any());
  CHECK_FALSE(promise_of("bvh8", "watertight", "fast").any());
  CHECK_FALSE(promise_of("two_level", "watertight", "padded", true).any());
  CHECK(promise_of("two_level", "watertight", "padded", false).any());
  CHECK(promise_of("bvh8", "watertight", "padded", true).any());
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
  const HardRays all = maker.make(7, 0, 4000, kinds), part = maker.make(7, 1000, 500, kinds), other = maker.make(8, 0, 4000, kinds);
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
  const auto share = [&](HardKind k) { return double(hits[static_cast<std::size_t>(k)]) / double(rays[static_cast<std::size_t>(k)]); };
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

TEST_CASE("cells keep their promises on spheres, fans and boxes, near and far from the origin") {
  const Registry registry = this_registry();
  std::vector<VerifiedCell> cells = promising_cells(registry);
  REQUIRE(cells.size() > 10);
  const std::array kinds{HardKind::vertex, HardKind::edge, HardKind::interior, HardKind::axis, HardKind::plane, HardKind::grazing,
                         HardKind::surface, HardKind::far, HardKind::interval, HardKind::invalid};
  const struct {
    const char* generator;
    std::size_t triangles;
    double offset;
    int exponent;
  } scenes[] = {{"sphere", 300, 0, 0}, {"sphere", 300, 1e4, 0}, {"fan", 64, 0, 0}, {"fan", 256, 100, 0}, {"sphere", 300, 0, -20}, {"fan", 64, 1e5, 10}};
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
    check_promises(cells, registry, c.mesh, rays);
  }
}

namespace {

/// What verify finds of the cell, by kind of ray, on rays aimed at the mesh.
std::vector<VerifyTally> tallies_of(const VerifiedCell& verified, const Registry& registry, const TriangleMesh& mesh, std::size_t count, std::span<const HardKind> kinds) {
  const HardRays rays = HardRayMaker(mesh).make(1, 0, count, kinds);
  const Oracle oracle(mesh);
  StructureShelf shelf(mesh, registry, 1);
  std::vector<Hit> hits;
  return verify_cell(verified.cell, shelf.get(verified.cell), {mesh, oracle, rays, oracle.closest_hit(rays.batch())}, hits, {});
}

}  // namespace

TEST_CASE("a kernel that leaks is told to leak, and a promise that it breaks is shown as a small case") {
  const Registry registry = this_registry();
  std::vector<VerifiedCell> cells = only(promising_cells(registry), "bvh8", "watertight");
  REQUIRE_FALSE(cells.empty());
  // A kernel of moller_trumbore that calls itself watertight.
  const KernelRow* leaky = nullptr;
  for (const KernelRow& row : registry.kernels)
    if (row.structure == "bvh8" && row.intersector == "moller_trumbore" && row.isa == cells[0].cell.isa && row.traversal == "single") leaky = &row;
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

TEST_CASE("the command's verdicts and words") {
  const std::string isa = "isa=" + any_isa();
  VerifyCommand command;
  command.subject = "sphere:200", command.axes = {"structure=bvh8,bvh4", "intersector=watertight", isa};
  command.rays = 3000, command.kinds = {"vertex", "edge"}, command.threads = 2;
  const Outcome kept = verify(command);
  CHECK(kept.status == 0);
  CHECK(kept.out.find("crack-free on closed meshes") != std::string::npos);
  CHECK(kept.out.find("all 2 cells that promise something keep it") != std::string::npos);
  CHECK(verify(command).out == kept.out);
  command.threads = 1;
  CHECK(verify(command).out == kept.out);

  command.spread = true;
  const Outcome shared = verify(command);
  CHECK(shared.out.find("3000 rays in all, 2 cells") != std::string::npos);
  CHECK(shared.out.find("all 2 cells that promise something keep it") != std::string::npos);
  command.rays = 100;
  const Outcome few = verify(command);  // one cell has them all: of the other nothing is said
  CHECK(few.out.find("all 1 cells that promise something keep it") != std::string::npos);
  CHECK(few.out.find("1 of 2 cells had no ray") != std::string::npos);
  CHECK(few.out.find("--rays 512") != std::string::npos);
  command.spread = false, command.rays = 3000;

  command.axes = {"structure=bvh8", "intersector=moller_trumbore", "box=fast", isa};
  const Outcome leaks = verify(command);
  CHECK(leaks.status == 0);  // it promises nothing
  CHECK(leaks.out.find("promised: nothing") != std::string::npos);
  CHECK(leaks.out.find("per million") != std::string::npos);

  command.axes = {isa, "structure=grid", "traversal=queued"};
  CHECK(verify(command).status == 4);

  const struct {
    const char* name;
    void (*change)(VerifyCommand&);
    const char* error;
  } faults[] = {
      {"kind", [](VerifyCommand& c) { c.kinds = {"edgy"}; }, "did you mean 'edge'"},
      {"axis", [](VerifyCommand& c) { c.axes = {"strukture=bvh8"}; }, "did you mean 'structure'"},
      {"value", [](VerifyCommand& c) { c.axes = {"structure=bvh9"}; }, "did you mean 'bvh"},
      {"workload", [](VerifyCommand& c) { c.axes = {"workload=primary"}; }, "rays of its own"},
      {"scene", [](VerifyCommand& c) { c.subject = "spere:200"; }, "spere"},
      {"no rays", [](VerifyCommand& c) { c.rays = 0; }, "--rays"},
      {"offset of cases", [](VerifyCommand& c) { c.subject = "x.json", c.offsets = {1}; }, "--offset"},
      {"scale", [](VerifyCommand& c) { c.scales = {500}; }, "exponent of two"},
      {"offset", [](VerifyCommand& c) { c.offsets = {1e30}, c.scales = {100}; }, "beyond float32"},
      {"no border", [](VerifyCommand& c) { c.kinds = {"border"}; }, "nothing that rays"},
      {"no file", [](VerifyCommand& c) { c.subject = "nowhere.json", c.kinds.clear(); }, "no such file"},
  };
  for (const auto& fault : faults) {
    INFO(fault.name);
    VerifyCommand wrong;
    wrong.subject = "sphere:200", wrong.axes = {isa}, wrong.rays = 100;
    fault.change(wrong);
    const Outcome outcome = verify(wrong);
    CHECK(outcome.status == 2);
    INFO(outcome.error);
    CHECK(outcome.error.find(fault.error) != std::string::npos);
    CHECK(outcome.error.find('\n') == std::string::npos);
  }
}

TEST_CASE("a scene of instances is moved only for structures that do not read them") {
  VerifyCommand command;
  command.subject = "forest:2000", command.rays = 500, command.axes = {"isa=" + any_isa(), "structure=two_level,bvh8", "intersector=watertight"};
  CHECK(verify(command).status == 0);
  command.offsets = {0}, command.scales = {0};
  CHECK(verify(command).status == 0);
  command.offsets = {0, 1};
  const Outcome moved = verify(command);
  CHECK(moved.status == 2);
  CHECK(moved.error.find("instances, which two_level is built over") != std::string::npos);
  CHECK(moved.error.find('\n') == std::string::npos);
  command.skip = "two_level";
  CHECK(verify(command).status == 0);
  command.skip.clear(), command.offsets.clear(), command.scales = {1};
  CHECK(verify(command).status == 2);
  command.subject = "sphere:200";
  CHECK(verify(command).status == 0);
}

TEST_CASE("cases files: right ones are checked, wrong ones are named") {
  const std::string isa = "isa=" + any_isa();
  const std::string triangles = R"("triangles": [[[0,0,1],[1,0,1],[0,1,1]]], "origin": [0.25,0.25,0], "direction": [0,0,1])";
  VerifyCommand command;
  command.axes = {isa, "structure=bvh8", "intersector=watertight"};
  const auto status_of = [&](const std::string& text, std::string* error = nullptr) {
    const auto path = written("cases.json", text);
    command.subject = path.string();
    const Outcome outcome = verify(command);
    if (error) *error = outcome.error;
    std::filesystem::remove(path);
    return outcome.status;
  };
  CHECK(status_of(R"({"cases": [{"id": "a", )" + triangles + R"(, "hit": true, "t": 1, "nearest_ids": [0]}]})") == 0);
  CHECK(status_of(R"({"cases": [{)" + triangles + "}]}") == 0);
  const struct {
    const char* text;
    const char* error;
  } faults[] = {
      {"{", "no JSON"},
      {"{}", "holds no"},
      {R"({"cases": [3]})", "is no object"},
      {R"({"cases": [{"id": "q"}]})", "case q: has no triangles"},
      {R"({"cases": [{"id": "q", "triangles": [[[0,0],[1,0,0],[0,1,0]]], "origin": [0,0,0], "direction": [0,0,1]}]})", "[x, y, z]"},
      {R"({"cases": [{"id": "q", "triangles": [[[0,0,1],[1,0,1],[0,1,1]]], "origin": ["big",0,0], "direction": [0,0,1]}]})", "is no number"},
      {R"({"cases": [{"id": "q", "triangles": [[[0,0,1],[1,0,1],[0,1,1]]], "origin": [0,0,0], "direction": [0,0,1], "hit": false}]})",
       "exact arithmetic finds a hit"},
      {R"({"cases": [{"id": "q", "triangles": [[[0,0,1],[1,0,1],[0,1,1]]], "origin": [0,0,0], "direction": [0,0,1], "t": 2}]})",
       "exact arithmetic finds 1"},
      {R"({"cases": [{"id": "q", "triangles": [[[3.4028236e38,0,1],[1,0,1],[0,1,1]]], "origin": [0,0,0], "direction": [0,0,1]}]})",
       "case q: triangles: 3.4028236e+38 is beyond float32"},
      {R"({"cases": [{"id": "p", "triangles": []}, {"id": "q", "triangles": [[[1e400,0,1],[1,0,1],[0,1,1]]], "origin": [0,0,0], "direction": [0,0,1]}]})",
       ".json: case q: 1e400 is beyond float32"},
      {R"({"cases": [{"origin": [0,0,-1e999]}]})", ".json: case 1: -1e999 is beyond float32"},
      {R"({"cases": [{"id": 5}]})", "case 1: id must be a string, not 5"},
      {R"({"cases": [{"id": "q", "tneer": 5}]})", "case q: unknown key 'tneer'; did you mean 'tnear'?"},
      {R"({"cases": [{"id": "q", "hitt": false}]})", "case q: unknown key 'hitt'; did you mean 'hit'?"},
  };
  for (const auto& fault : faults) {
    INFO(fault.text);
    std::string error;
    CHECK(status_of(fault.text, &error) == 2);
    INFO(error);
    CHECK(error.find(fault.error) != std::string::npos);
  }
  // Each part of a wrong answer is told, whatever is given beside it: of two triangles at t = 1 and one behind them, and of a miss.
  const std::string three = R"({"cases": [{"id": "q", "triangles": [[["nan",0,1],[0,0,1],[0,0,1]],[[0,0,1],[1,0,1],[0,1,1]],[[0,0,2],[1,0,2],[0,1,2]],[[0,0,1],[1,0,1],[0,1,1]]], )"
                            R"("direction": [0,0,1], "origin": )";
  const std::string hit = three + "[0.25,0.25,0], ", miss = three + "[5,0,0], ";
  const struct {
    const std::string& base;
    const char* answer;
    const char* error;  ///< empty: a right answer
  } answers[] = {
      {hit, R"("hit": true, "t": 1.0, "nearest_ids": [1,3], "closed_hits": 3)", ""},
      {hit, R"("nearest_ids": [3,1])", ""},
      {hit, R"("hit": true, "nearest_ids": [1])", "nearest_ids is [1], but exact arithmetic finds [1,3]"},
      {hit, R"("nearest_ids": [1,2,3])", "exact arithmetic finds [1,3]"},
      {hit, R"("nearest_ids": [])", "exact arithmetic finds [1,3]"},
      {hit, R"("t": null)", "t is null, but exact arithmetic finds 1"},
      {hit, R"("closed_hits": 2)", "exact arithmetic finds 3"},
      {hit, R"("hit": "no")", "hit must be true or false, not \"no\""},
      {hit, R"("nearest_ids": 0)", "nearest_ids must be a list of whole numbers, not 0"},
      {hit, R"("nearest_ids": [1,-3])", "nearest_ids must be a list of whole numbers"},
      {hit, R"("t": "inf")", "t must be a number, or null for a miss, not \"inf\""},
      {hit, R"("closed_hits": 1.5)", "closed_hits must be a whole number, not 1.5"},
      {miss, R"("hit": false, "t": null, "nearest_ids": [], "closed_hits": 0)", ""},
      {miss, R"("hit": false, "t": 3)", "t is 3, but exact arithmetic finds a miss"},
      {miss, R"("t": 3)", "t is 3, but exact arithmetic finds a miss"},
      {miss, R"("hit": false, "nearest_ids": [0])", "nearest_ids is [0], but exact arithmetic finds []"},
      {miss, R"("hit": true)", "exact arithmetic finds a miss"},
  };
  for (const auto& a : answers) {
    INFO(a.answer);
    std::string error;
    CHECK(status_of(a.base + a.answer + "}]}", &error) == (*a.error ? 2 : 0));
    INFO(error);
    CHECK((*a.error ? error.find(a.error) != std::string::npos : error.empty()));
  }
  // --rays: in all, the cases among them; no more than the cases where none can be mutated.
  const auto rays_of = [&](const std::string& text, std::uint64_t rays) {
    const auto file = written("rays.json", text);
    VerifyCommand more = command;
    more.subject = file.string(), more.rays = rays;
    const std::string out = verify(more).out;
    std::filesystem::remove(file);
    return out.substr(0, out.find('\n'));
  };
  const std::string flat = R"("triangles": [[["nan",0,1],[1,0,1],[0,1,1]]], "origin": [0,0,0], "direction": [0,0,1])";
  const std::string none = R"({"cases": [{"id": "a", )" + flat + R"(}, {"id": "b", )" + flat + "}]}", one = R"({"cases": [{"id": "a", )" + flat + "}, {" + triangles + "}]}";
  CHECK(rays_of(none, 100).find("2 cases, 2 rays") != std::string::npos);
  CHECK(rays_of(one, 100).find("2 cases and 2 random meshes, 100 rays") != std::string::npos);
  // tnear below 0: where 0 would have the same answer.
  const std::string wall = R"({"cases": [{"id": "q", "triangles": [[[0,0,1],[1,0,1],[0,1,1]]], "direction": [0,0,1], "tnear": )";
  const std::string refused = "case q: tnear -10 is below 0 and something lies there";
  std::string error;
  CHECK(status_of(wall + R"(-10, "origin": [0.25,0.25,0], "hit": true})" + "]}", &error) == 0);
  CHECK(status_of(wall + R"(-10, "origin": [0.25,0.25,1], "hit": true})" + "]}", &error) == 0);
  CHECK(status_of(wall + R"("-inf", "origin": [0.25,0.25,0], "hit": true})" + "]}", &error) == 0);
  CHECK(status_of(wall + R"(-10, "tfar": -5, "origin": [0.25,0.25,4], "hit": false})" + "]}", &error) == 0);
  CHECK(status_of(wall + R"(-10, "tfar": -5, "origin": [0.25,0.25,7]})" + "]}", &error) == 2);
  CHECK(error.find(refused) != std::string::npos);
  CHECK(status_of(wall + R"(-10, "origin": [0.25,0.25,4], "hit": true, "t": -3})" + "]}", &error) == 2);
  CHECK(error.find(refused) != std::string::npos);
  CHECK(error.find('\n') == std::string::npos);
  VerifyCase behind;
  add_triangle(behind.mesh, {0, 0, 1}, {1, 0, 1}, {0, 1, 1});
  behind.ray = {{0.25f, 0.25f, 0}, -10.0f, {0, 0, 1}, 2.0f};
  for (std::uint64_t i = 0; i < 20; ++i) CHECK(mutated_subject(behind.mesh, behind.ray, 1, i, 1).rays.rays[0].tnear == 0);
  CHECK(read_case_file(kSource / "tests/hard_cases.json").size() == 96);
  // What is written is read back, the largest float included, whose shortest decimal lies beyond it.
  TriangleMesh mesh;
  add_triangle(mesh, {0.1f, 1e-30f, 1}, {1, 0, 1}, {0, 16777216, 1});
  add_triangle(mesh, {std::numeric_limits<float>::max(), 0, 1}, {0, std::numeric_limits<float>::lowest(), 1}, {0x1p-149f, 0, 1});
  const Ray ray{{0.3f, 0.7f, 0}, 0.0f, {0, 0, 1}, 0x1.fp120f};
  const auto path = written("back.json", R"({"cases": [)" + case_json("back", "why", mesh, ray) + "]}");
  const VerifyCase back = read_case_file(path).front();
  std::filesystem::remove(path);
  CHECK(std::memcmp(&back.ray, &ray, sizeof ray) == 0);
  CHECK(back.mesh.vertices == mesh.vertices);
}
