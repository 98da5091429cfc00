// `verify` as a command: its verdicts and words, scenes of instances, and the cases files that it reads.
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "core/error.h"
#include "experiments/case_file.h"
#include "experiments/commands.h"
#include "oracle/random_cases.h"
#include "tests/catch.h"
#include "tests/folder.h"
#include "tests/small_meshes.h"
#include "tests/kernel_runner.h"
#include "traversal/kernel_table.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

const fs::path kSource = ARBORETUM_SOURCE_DIR;

struct Outcome {
  int status = 0;
  std::string out, error;
};

/// The program's command, its words on stdout and the error that it throws.
Outcome verify(const VerifyCommand& command, const Registry* registry = nullptr) {
  Outcome outcome;
  const Folder folder;
  const fs::path path = folder / "stdout";
  std::fflush(stdout);
  const int saved = dup(1);
  REQUIRE(std::freopen(path.c_str(), "w", stdout));
  try {
    outcome.status = static_cast<int>(registry ? command_verify(command, *registry) : command_verify(command));
  } catch (const UserError& e) {
    outcome.status = static_cast<int>(ExitStatus::kUsage), outcome.error = e.what();
  }
  std::fflush(stdout);
  dup2(saved, 1);
  close(saved);
  std::stringstream text;
  text << std::ifstream(path).rdbuf();
  outcome.out = text.str();
  return outcome;
}

std::string any_isa() { return std::string(to_string(tested_isa())); }

}  // namespace

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
  command.subject = "forest:2000", command.rays = 500,
  command.axes = {"isa=" + any_isa(), "structure=two_level,bvh8", "intersector=watertight"};
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

namespace {

const KernelRow* first_liar = nullptr;

/// The row that a liar stands for.
const KernelRow& honest(const KernelRow& liar) { return kernel_table()[static_cast<std::size_t>(&liar - first_liar)]; }

/// A registry in which the rows of `intersector` for these structures are liars.
Registry with_liars(std::vector<KernelRow>& rows, std::string_view intersector,
                    const std::vector<std::pair<std::string_view, ClosestHitFunction>>& liars) {
  Registry registry = this_registry();
  rows.assign(kernel_table().begin(), kernel_table().end());
  for (KernelRow& row : rows)
    for (const auto& [structure, lie] : liars)
      if (row.structure == structure && row.intersector == intersector) row.timed.closest_hit = lie;
  first_liar = rows.data(), registry.kernels = rows;
  return registry;
}

void all_miss(std::span<Hit> hits) { std::ranges::fill(hits, Hit{}); }

bool is_far_off(const RayBatch& rays) { return rays.rays.size() > 0 && std::fabs(rays.rays[0].origin.x) > 100; }

/// What --out holds of a run with these liars.
std::string cases_of(VerifyCommand command, const Registry& registry) {
  const Folder folder;
  command.out = folder.path();
  CHECK(verify(command, &registry).status == 1);
  std::stringstream text;
  text << std::ifstream(folder.path() / "cases.json").rdbuf();
  if (text.str().find("{\"cases\": [\n\n]") != 0) CHECK_FALSE(read_case_file(folder.path() / "cases.json").empty());
  return text.str();
}

}  // namespace

TEST_CASE("each placing of a scene has rays of its own, and each keeps its cases") {
  // Both miss everything, one where the scene stands, the other far off: on rays of the same number.
  std::vector<KernelRow> rows;
  const Registry registry = with_liars(
      rows, "watertight",
      {{"bvh4",
        [](const Accel& accel, const KernelRow& row, RayBatch batch, std::span<Hit> hits, Counters* counters) {
          honest(row).closest_hit(accel, batch, hits, counters);
          if (!is_far_off(batch)) all_miss(hits);
        }},
       {"bvh8", [](const Accel& accel, const KernelRow& row, RayBatch batch, std::span<Hit> hits, Counters* counters) {
          honest(row).closest_hit(accel, batch, hits, counters);
          if (is_far_off(batch)) all_miss(hits);
        }}});
  VerifyCommand command;
  command.subject = "sphere:200", command.axes = {"structure=bvh4,bvh8", "intersector=watertight", "isa=" + any_isa()};
  command.rays = 400, command.kinds = {"interior"}, command.offsets = {0, 1000}, command.threads = 1;
  const std::string cases = cases_of(command, registry);
  INFO(cases);
  CHECK(cases.find("\"id\":\"sphere-200-offset0-scale0-ray0\"") != std::string::npos);
  CHECK(cases.find("\"id\":\"sphere-200-offset1000-scale0-ray0\"") != std::string::npos);
}

namespace {
std::vector<std::pair<char, std::size_t>> traced;  // last letter of the structure's name, rays
}  // namespace

TEST_CASE("rays that are spread: the batches of a cell follow each other, and cells have as many but for one") {
  std::vector<KernelRow> rows;
  const auto record = [](const Accel& accel, const KernelRow& row, RayBatch batch, std::span<Hit> hits,
                         Counters* counters) {
    honest(row).closest_hit(accel, batch, hits, counters);
    if (traced.empty() || traced.back().first != row.structure.back()) traced.emplace_back(row.structure.back(), 0);
    traced.back().second += batch.size();
  };
  const Registry registry = with_liars(rows, "exact", {{"bvh2", record}, {"bvh4", record}, {"bvh8", record}});
  VerifyCommand command;
  command.subject = "sphere:200", command.threads = 1, command.spread = true, command.kinds = {"interior"};
  command.axes = {"structure=bvh2,bvh4,bvh8", "intersector=exact", "box=padded", "isa=" + any_isa()};
  constexpr std::size_t kBatch = 1 << 14;  // the largest
  command.rays = 7 * kBatch + 100;
  traced.clear();
  CHECK(verify(command, &registry).status == 0);
  CHECK(traced == std::vector<std::pair<char, std::size_t>>{{'2', 3 * kBatch}, {'4', 3 * kBatch}, {'8', kBatch + 100}});
  // Fewer batches than cells: the next scene's go to those that had none.
  command.rays = 2 * 256, command.offsets = {0, 1}, command.kinds = {"interior"};
  traced.clear();
  CHECK(verify(command, &registry).status == 0);
  CHECK(traced == std::vector<std::pair<char, std::size_t>>{{'2', 256}, {'4', 256}});
}

namespace {
int calls = 0;
}  // namespace

TEST_CASE("a breach that no case could be made of leaves the next one its turn") {
  std::vector<KernelRow> rows;
  const Registry registry = with_liars(
      rows, "exact",
      {{"bvh8", [](const Accel& accel, const KernelRow& row, RayBatch batch, std::span<Hit> hits, Counters* counters) {
          honest(row).closest_hit(accel, batch, hits, counters);
          // Once, on the first mesh, and always from the ninth or so on
          if (++calls == 1 || calls > 10) all_miss(hits);
        }}});
  VerifyCommand command;
  command.subject = "random", command.axes = {"structure=bvh8", "intersector=exact", "isa=" + any_isa()};
  command.rays = 64 * 20, command.threads = 1;
  calls = 0;
  const std::string cases = cases_of(command, registry);
  INFO(cases);
  CHECK(cases.find("{\"id\":\"random-seed1-") != std::string::npos);
  CHECK(cases.find("\"unreduced\"") == std::string::npos);
}

TEST_CASE("a breach that cannot be made small is kept as its scene's ray") {
  // Honest on small meshes: what no part of the scene shows
  std::vector<KernelRow> rows;
  const Registry registry = with_liars(
      rows, "watertight",
      {{"bvh8", [](const Accel& accel, const KernelRow& row, RayBatch batch, std::span<Hit> hits, Counters* counters) {
          honest(row).closest_hit(accel, batch, hits, counters);
          if (accel.bytes() > 100'000) all_miss(hits);
        }}});
  VerifyCommand command;
  command.subject = "sphere:5000", command.axes = {"structure=bvh8", "intersector=watertight", "isa=" + any_isa()};
  command.rays = 400, command.kinds = {"interior"}, command.threads = 1;
  const std::string cases = cases_of(command, registry);
  INFO(cases);
  CHECK(cases.find("{\"cases\": [\n\n], \"unreduced\": [\n{\"id\":\"sphere-5000-offset0-scale0-ray0\",\"origin\":[") ==
        0);
  CHECK(cases.find("\"why\":\"bvh8/") != std::string::npos);
  CHECK(cases.find("lost through a closed surface") != std::string::npos);
}

TEST_CASE("cases files: right ones are checked, wrong ones are named") {
  const std::string isa = "isa=" + any_isa();
  const std::string triangles =
      R"("triangles": [[[0,0,1],[1,0,1],[0,1,1]]], "origin": [0.25,0.25,0], "direction": [0,0,1])";
  VerifyCommand command;
  command.axes = {isa, "structure=bvh8", "intersector=watertight"};
  const auto status_of = [&](const std::string& text, std::string* error = nullptr) {
    const Folder folder;
    const fs::path path = folder.write("cases.json", text);
    command.subject = path.string();
    const Outcome outcome = verify(command);
    if (error) *error = outcome.error;
    return outcome.status;
  };
  CHECK(status_of(R"({"cases": [{"id": "a", )" + triangles + R"(, "hit": true, "t": 1, "nearest_ids": [0]}]})") == 0);
  CHECK(status_of(R"({"cases": [{)" + triangles + "}]}") == 0);
  const struct {
    const char* text;
    const char* error;
  } faults[] = {
      {R"({"cases": [], "cases": []})", "\"cases\" is given twice; keep one"},
      {R"({"cases": [{"id": "a", "id": "b"}]})", "case a: \"id\" is given twice; keep one"},
      {"{", ":1: no JSON: unexpected end of input; expected string literal; mend"},
      {"{}", "holds no"},
      {R"({"cases": [3]})", "is no object"},
      {R"({"cases": [{"id": "q"}]})", "case q: has no triangles"},
      {R"({"cases": [{"id": "q", "triangles": [[[0,0],[1,0,0],[0,1,0]]], "origin": [0,0,0], "direction": [0,0,1]}]})",
       "[x, y, z]"},
      {R"({"cases": [{"id": "q", "triangles": [[[0,0,1],[1,0,1],[0,1,1]]], "origin": ["big",0,0], "direction": [0,0,1]}]})",
       "is no number"},
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
  // Each part of a wrong answer is told, whatever is given beside it: of two triangles at t = 1 and one behind them,
  // and of a miss.
  const std::string three =
      R"({"cases": [{"id": "q", "triangles": [[["nan",0,1],[0,0,1],[0,0,1]],[[0,0,1],[1,0,1],[0,1,1]],[[0,0,2],[1,0,2],[0,1,2]],[[0,0,1],[1,0,1],[0,1,1]]], )"
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
      {hit, R"("nearest_ids": [1,3,3])", "nearest_ids names an id twice: [1,3,3]"},
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
    const Folder folder;
    const fs::path file = folder.write("rays.json", text);
    VerifyCommand more = command;
    more.subject = file.string(), more.rays = rays;
    const std::string out = verify(more).out;
    return out.substr(0, out.find('\n'));
  };
  const std::string flat = R"("triangles": [[["nan",0,1],[1,0,1],[0,1,1]]], "origin": [0,0,0], "direction": [0,0,1])";
  const std::string none = R"({"cases": [{"id": "a", )" + flat + R"(}, {"id": "b", )" + flat + "}]}",
                    one = R"({"cases": [{"id": "a", )" + flat + "}, {" + triangles + "}]}";
  CHECK(rays_of(none, 100).find("2 cases, 2 rays") != std::string::npos);
  CHECK(rays_of(one, 100).find("2 cases and 2 random meshes, 100 rays") != std::string::npos);
  // tnear below 0: where 0 would have the same answer.
  const std::string wall =
      R"({"cases": [{"id": "q", "triangles": [[[0,0,1],[1,0,1],[0,1,1]]], "direction": [0,0,1], "tnear": )";
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
  for (std::uint64_t i = 0; i < 20; ++i)
    CHECK(mutated_subject(behind.mesh, behind.ray, 1, i, 1).rays.rays[0].tnear == 0);
  CHECK(read_case_file(kSource / "tests/hard_cases.json").size() == 96);
  // What is written is read back, the largest float included, whose shortest decimal lies beyond it.
  TriangleMesh mesh;
  add_triangle(mesh, {0.1f, 1e-30f, 1}, {1, 0, 1}, {0, 16777216, 1});
  add_triangle(mesh, {std::numeric_limits<float>::max(), 0, 1}, {0, std::numeric_limits<float>::lowest(), 1},
               {0x1p-149f, 0, 1});
  const Ray ray{{0.3f, 0.7f, 0}, 0.0f, {0, 0, 1}, 0x1.fp120f};
  const Folder folder;
  const fs::path path = folder.write("back.json", R"({"cases": [)" + case_json("back", "why", mesh, ray) + "]}");
  const VerifyCase back = read_case_file(path).front();
  CHECK(std::memcmp(&back.ray, &ray, sizeof ray) == 0);
  CHECK(back.mesh.vertices == mesh.vertices);
}
