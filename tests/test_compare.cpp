// The rank test against known values; two runs compared: nothing where nothing changed, a regression where there is
// one.
#include <fmt/format.h>

#include <tuple>

#include "experiments/comparison.h"
#include "experiments/comparison_files.h"
#include "experiments/comparison_text.h"
#include "experiments/significance.h"
#include "core/random.h"
#include "tests/catch.h"
#include "tests/experiments_on_paper.h"

using namespace arboretum;
using namespace arboretum::test;

TEST_CASE("Mann-Whitney: exact p-values, with ties, and the normal distribution beyond") {
  // 2 / C(6, 3), 2 / C(14, 7): samples that do not overlap.
  CHECK(mann_whitney_p(std::vector{1.0, 2.0, 3.0}, std::vector{4.0, 5.0, 6.0}) == Approx(0.1));
  CHECK(mann_whitney_p(std::vector{1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0},
                       std::vector{8.0, 9.0, 10.0, 11.0, 12.0, 13.0, 14.0}) == Approx(2.0 / 3432.0));
  CHECK(smallest_p(7, 7) == Approx(2.0 / 3432.0));
  CHECK(smallest_p(1, 1) == 1.0);
  // By hand: of the C(4, 2) = 6 pairs of ranks, sums 3 4 5 5 6 7; {1, 3} is 4, one from the mean 5, as are 3, 6 and 7.
  CHECK(mann_whitney_p(std::vector{1.0, 3.0}, std::vector{2.0, 4.0}) == Approx(4.0 / 6.0));
  // Ties: midranks 1.5 1.5 3.5 3.5; sums 3 5 5 5 5 7.
  CHECK(mann_whitney_p(std::vector{1.0, 1.0}, std::vector{2.0, 2.0}) == Approx(2.0 / 6.0));
  CHECK(mann_whitney_p(std::vector{1.0, 2.0}, std::vector{1.0, 2.0}) == Approx(1.0));
  CHECK(mann_whitney_p(std::vector{5.0, 5.0, 5.0}, std::vector{5.0, 5.0, 5.0}) == 1.0);
  CHECK(mann_whitney_p({}, std::vector{1.0}) == 1.0);
  // 25 and 25 values are exact, 26 and 26 are not: the two must agree.
  for (double shift : {0.0, 5.5, 10.5}) {
    std::vector<double> a, b;
    for (int i = 0; i < 25; ++i) a.push_back(i), b.push_back(i + shift);
    const double exact = mann_whitney_p(a, b);
    a.push_back(12.0), b.push_back(12.0 + shift);
    CHECK(mann_whitney_p(a, b) == Approx(exact).margin(0.02));
  }
}

TEST_CASE("Mann-Whitney finds a difference where there is none as often as it says") {
  int found = 0;
  constexpr int kTrials = 2000;
  for (int trial = 0; trial < kTrials; ++trial) {
    std::vector<double> a, b;
    for (std::uint64_t i = 0; i < 7; ++i)
      a.push_back(random_double(7, i, 2 * trial)), b.push_back(random_double(7, i, 2 * trial + 1));
    found += mann_whitney_p(a, b) <= 0.05;
  }
  CHECK(found < 0.065 * kTrials);
  CHECK(found > 0.025 * kTrials);
}

TEST_CASE("Welch: known p-values, and none without spread or with one value") {
  // t = 3.674235, 4 degrees of freedom: 0.02131 by tables of t.
  CHECK(welch_p(std::vector{1.0, 2.0, 3.0}, std::vector{4.0, 5.0, 6.0}) == Approx(0.0213117).epsilon(1e-4));
  // Variances 1 and 100: t = -0.9 / sqrt((1 + 100) / 3), 101^2 / (1 + 10^4) * 2 = 2.03998 degrees of freedom.
  CHECK(welch_p(std::vector{1.0, 2.0, 3.0}, std::vector{-7.1, 2.9, 12.9}) == Approx(0.8907).margin(2e-4));
  CHECK(welch_p(std::vector{1.0, 1.0}, std::vector{2.0, 2.0}) == 0.0);
  CHECK(welch_p(std::vector{1.0, 1.0}, std::vector{1.0, 1.0}) == 1.0);
  CHECK(welch_p(std::vector{1.0}, std::vector{2.0, 3.0}) == 1.0);
  CHECK(welch_p({}, std::vector{2.0, 3.0}) == 1.0);
}

TEST_CASE("Benjamini-Hochberg") {
  CHECK(benjamini_hochberg({}).empty());
  const std::vector<double> adjusted = benjamini_hochberg(std::vector{0.04, 0.01, 0.03, 0.5});
  CHECK(adjusted[1] == Approx(0.04));              // 0.01 * 4
  CHECK(adjusted[2] == Approx(0.04 * 4.0 / 3.0));  // 0.03 * 4 / 2 = 0.06, but no more than the next
  CHECK(adjusted[0] == Approx(0.04 * 4.0 / 3.0));
  CHECK(adjusted[3] == Approx(0.5));
}

namespace {

Cell cell_named(const std::string& structure, Cell::Metric metric = Cell::Metric::trace) {
  const bool build = metric == Cell::Metric::build;
  Cell cell;
  cell.metric = metric;
  cell.scene = "bunny", cell.structure = structure, cell.builder = "binned_sah", cell.leaf = "triangle4",
  cell.isa = Isa::sse;
  cell.intersector = build ? "-" : "watertight", cell.box = build ? "-" : "padded",
  cell.traversal = build ? "-" : "single", cell.workload = build ? "-" : "primary";
  return cell;
}

/// A result of repetitions about `seconds`, each off by up to `noise`.
CellResult measured(const Cell& cell, double seconds, double noise, std::uint64_t seed, unsigned repetitions = 9) {
  CellResult result{
      .cell = cell,
      .repetitions = {},
      .facts = {{"rays", 1000}, {"triangles", 500}, {"wrong_answers", 0}, {"sah_cost", 20.0}, {"bytes", 64000}}};
  for (unsigned i = 0; i < repetitions; ++i) {
    const double s = seconds * (1.0 + noise * (2.0 * random_double(seed, i, 0) - 1.0));
    result.repetitions.push_back(
        {.index = i, .iterations = 3, .wall_seconds = 6.0 * s, .cpu_seconds = 3.0 * s, .phases = {}});
  }
  return result;
}

std::vector<CellResult> run(std::uint64_t seed, double noise = 0.02, unsigned repetitions = 9) {
  std::vector<CellResult> results;
  for (const char* structure : {"bvh2", "bvh4", "bvh8", "kdtree"}) {
    results.push_back(measured(cell_named(structure, Cell::Metric::build), 0.02, noise, ++seed * 31, repetitions));
    results.push_back(measured(cell_named(structure), 0.1, noise, ++seed * 31, repetitions));
  }
  return results;
}

CellResult* find(std::vector<CellResult>& results, const std::string& structure,
                 Cell::Metric metric = Cell::Metric::trace) {
  for (CellResult& r : results)
    if (r.cell.structure == structure && r.cell.metric == metric) return &r;
  return nullptr;
}

const ComparedCell& find(const Comparison& comparison, const std::string& structure, bool trace = true) {
  for (const ComparedCell& c : comparison.cells)
    if (c.a.cell.structure == structure && c.is_trace() == trace) return c;
  FAIL("no such cell");
  return comparison.cells.front();
}

void slow_down(CellResult& result, double factor) {
  for (Repetition& r : result.repetitions) r.wall_seconds *= factor, r.cpu_seconds *= factor;
}

}  // namespace

TEST_CASE("a run compared with itself is indistinguishable, and of ratio 1") {
  const std::vector<CellResult> a = run(1);
  const Comparison c = compare_results(a, a, {});
  REQUIRE(c.cells.size() == 8);
  for (const ComparedCell& cell : c.cells) {
    CHECK(cell.ratio.median == Approx(1.0));
    CHECK((cell.ratio.low <= 1.0 && cell.ratio.high >= 1.0));
    CHECK(cell.p == 1.0);
    CHECK(cell.verdict == Verdict::indistinguishable);
  }
  CHECK(verdict(c).first == ExitStatus::kDone);
  CHECK(c.structures.empty());
  CHECK((c.only_a.empty() && c.only_b.empty()));
}

TEST_CASE("noise about equal medians is indistinguishable; however often it is tried, hardly ever a regression") {
  int regressions = 0;
  for (std::uint64_t trial = 0; trial < 50; ++trial)
    regressions += compare_results(run(1000 * trial + 1, 0.15), run(1000 * trial + 500, 0.15), {}).is_regression();
  CHECK(regressions <= 3);  // 50 comparisons of 8 cells, of which one in twenty may be false
}

TEST_CASE("a slower structure is a regression, with the right ratio; the others are not blamed") {
  const std::vector<CellResult> a = run(1);
  std::vector<CellResult> b = run(900);
  slow_down(*find(b, "bvh8"), 1.25);
  const Comparison c = compare_results(a, b, {});
  const ComparedCell& slow = find(c, "bvh8");
  CHECK(slow.verdict == Verdict::slower);
  CHECK(slow.ratio.median == Approx(0.8).epsilon(0.03));
  CHECK((slow.ratio.low < 0.8 * 1.01 && slow.ratio.high > 0.8 * 0.99 && slow.ratio.high < 0.9));
  CHECK(slow.adjusted_p < 0.01);
  CHECK(c.count(Verdict::slower) == 1);
  CHECK(verdict(c).first == ExitStatus::kRegression);
  CHECK(comparison_text(c, false).find("slower") != std::string::npos);
  // The other way round it is an improvement, and no regression.
  const Comparison back = compare_results(b, a, {});
  CHECK(find(back, "bvh8").verdict == Verdict::faster);
  CHECK(verdict(back).first == ExitStatus::kDone);
  // Of no concern where only more counts, nor where the interval reaches below what counts.
  CHECK(find(compare_results(a, b, {.min_difference = 40.0, .control = {}}), "bvh8").verdict ==
        Verdict::indistinguishable);
  const double nearly = 100.0 * (1.0 / slow.ratio.high - 1.0) + 0.1;
  CHECK(find(compare_results(a, b, {.min_difference = nearly, .control = {}}), "bvh8").verdict ==
        Verdict::indistinguishable);

  slow_down(*find(b, "kdtree", Cell::Metric::build), 2.0);
  const Comparison builds = compare_results(a, b, {});
  CHECK(find(builds, "kdtree", false).verdict == Verdict::slower);
  CHECK(find(builds, "kdtree", false).ratio.median == Approx(0.5).epsilon(0.03));
}

TEST_CASE("significant but smaller than counts is no regression, and known to be so small") {
  const std::vector<CellResult> a = run(1, 0.001);
  std::vector<CellResult> b = a;
  for (CellResult& r : b) slow_down(r, 1.01);
  const Comparison c = compare_results(a, b, {});
  CHECK(find(c, "bvh8").adjusted_p < 0.01);
  CHECK(c.count(Verdict::indistinguishable) == c.cells.size());
  CHECK(find(c, "bvh8").equal);
  REQUIRE(!c.means.empty());
  CHECK(c.means.front().ratio.median == Approx(1.0 / 1.01).epsilon(0.001));
  CHECK(c.means.front().ratio.high < 1.0);
  CHECK(compare_results(a, b, {.min_difference = 0.5, .control = {}}).count(Verdict::slower) == c.cells.size());
}

TEST_CASE("few repetitions tell a difference that is large against the noise") {
  for (std::size_t repetitions : {2u, 3u, 4u}) {
    INFO(repetitions << " repetitions");
    std::vector<CellResult> a = run(1, 0.01, repetitions), b = run(900, 0.01, repetitions);
    slow_down(*find(b, "bvh8"), 2.0);
    const Comparison c = compare_results(a, b, {});
    CHECK(find(c, "bvh8").test == SignificanceTest::welch);
    CHECK(find(c, "bvh8").verdict == Verdict::slower);
    CHECK(c.count(Verdict::slower) == 1);
    CHECK(c.count(Verdict::undecided) == 0);
    CHECK(verdict(c).first == ExitStatus::kRegression);
    CHECK(comparison_text(c, false).find("Welch") != std::string::npos);
    CHECK(verdict(compare_results(b, a, {})).first == ExitStatus::kDone);
  }
  // Ranks of seven repetitions, all apart, reach 2 / C(14, 7) = 0.0006: enough for 8 cells, not for 160.
  const std::vector<CellResult> a = run(1, 0.01, 7), b = run(900, 0.01, 7);
  CHECK(find(compare_results(a, b, {}), "bvh8").test == SignificanceTest::mann_whitney);
  std::vector<CellResult> many_a, many_b;
  for (std::uint64_t k = 0; k < 20; ++k) {
    for (auto [of, seed] : {std::pair{&many_a, 2 * k}, std::pair{&many_b, 2 * k + 1}}) {
      for (CellResult& r : run(100 * seed + 1, 0.01, 7)) {
        r.cell.scene = "scene" + std::to_string(k);
        of->push_back(std::move(r));
      }
    }
  }
  slow_down(*find(many_b, "bvh8"), 2.0);
  const Comparison many = compare_results(many_a, many_b, {});
  REQUIRE(many.cells.size() == 160);
  CHECK(find(many, "bvh8").test == SignificanceTest::welch);
  CHECK(find(many, "bvh8").verdict == Verdict::slower);
  CHECK(many.count(Verdict::slower) == 1);
}

TEST_CASE("the interval of a ratio covers it 95 times in 100 from five repetitions on; of fewer it is not called so") {
  const auto text = [](unsigned repetitions) {
    return comparison_text(compare_results(run(1, 0.02, repetitions), run(900, 0.02, repetitions), {}), false);
  };
  for (const auto& [repetitions, words] : {std::pair{2u, "of 2 repetitions covers it 67 times in 100"},
                                           {3u, "of 3 repetitions covers it 90 times in 100"},
                                           {4u, "of 4 repetitions covers it 93 times in 100"}}) {
    CHECK(text(repetitions).find(words) != std::string::npos);
    CHECK(text(repetitions).find("95 %") == std::string::npos);
  }
  CHECK(text(5).find("95 % bootstrap interval") != std::string::npos);

  constexpr std::uint64_t kTrials = 600;
  const CellResult cell = measured(cell_named("bvh2"), 1.0, 0.0, 1);
  for (const auto& [repetitions, least, most] :
       {std::tuple{2u, 0.62, 0.72}, {3u, 0.87, 0.93}, {5u, 0.945, 0.99}, {7u, 0.945, 0.99}}) {
    std::size_t covered = 0;
    for (std::uint64_t trial = 0; trial < kTrials; ++trial) {
      const Comparison c = compare_results({measured(cell.cell, 1.0, 0.1, 2 * trial + 1, repetitions)},
                                           {measured(cell.cell, 1.0, 0.1, 2 * trial + 2, repetitions)}, {});
      covered += c.cells[0].ratio.low <= 1.0 && c.cells[0].ratio.high >= 1.0;
    }
    INFO(repetitions << " repetitions: " << covered << " of " << kTrials);
    CHECK(covered >= least * kTrials);
    CHECK(covered <= most * kTrials);
  }
}

TEST_CASE("noise of few repetitions is hardly ever a regression either") {
  for (std::size_t repetitions : {2u, 3u, 5u}) {
    int regressions = 0;
    for (std::uint64_t trial = 0; trial < 50; ++trial)
      regressions +=
          compare_results(run(1000 * trial + 1, 0.15, repetitions), run(1000 * trial + 500, 0.15, repetitions), {})
              .is_regression();
    INFO(repetitions << " repetitions: " << regressions << " of 50");
    CHECK(regressions <= 3);
  }
}

TEST_CASE("a single repetition is undecided, never a verdict") {
  std::vector<CellResult> a = run(1, 0.02, 1), b = run(900, 0.02, 1);
  slow_down(*find(b, "bvh8"), 2.0);
  const Comparison one = compare_results(a, b, {});
  CHECK(one.count(Verdict::undecided) == one.cells.size());
  CHECK(verdict(one).first == ExitStatus::kDone);
  CHECK(comparison_text(one, false).find("one repetition tells nothing") != std::string::npos);
  CHECK(comparison_text(one, false).find('[') == std::string::npos);
  CHECK(Json::parse(comparison_json(one, {}, {}))["cells"][0]["ratio_low"].is_null());
  // It looks halved: the last line says so, and --strict takes it for slower; what looks faster it leaves alone.
  CHECK(find(one, "bvh8").is_suspect());
  const std::string last = verdict(one).second;
  CHECK(last.find("no regression found") != std::string::npos);
  CHECK(last.find(find(one, "bvh8").a.cell.name()) != std::string::npos);
  CHECK(verdict(compare_results(a, b, {.strict = true})).first == ExitStatus::kRegression);
  CHECK(verdict(compare_results({*find(b, "bvh8")}, {*find(a, "bvh8")}, {.strict = true})).first == ExitStatus::kDone);
  CHECK(verdict(compare_results(a, a, {.strict = true})).second.find("beyond") == std::string::npos);
}

TEST_CASE("new wrong answers are a regression, fewer are not; changed trees are told") {
  const std::vector<CellResult> a = run(1);
  std::vector<CellResult> b = a;
  find(b, "bvh4")->facts["wrong_answers"] = 2;
  find(b, "bvh2")->facts["sah_cost"] = 21.0, find(b, "bvh2")->facts["bytes"] = 32000;
  const Comparison c = compare_results(a, b, {});
  CHECK(c.more_wrong() == 1);
  CHECK(verdict(c).first == ExitStatus::kRegression);
  CHECK(verdict(compare_results(b, a, {})).first == ExitStatus::kDone);
  REQUIRE(c.structures.size() == 1);
  CHECK(c.structures[0].structure == "bunny/bvh2/binned_sah/triangle4");
  CHECK(*c.structures[0].sah_b == 21.0);
  CHECK(*c.structures[0].bytes_b == 32000);
  find(b, "bvh4")->facts.erase("wrong_answers");
  CHECK(compare_results(a, b, {}).more_wrong() == 0);
  CHECK(comparison_text(compare_results(a, b, {}), false).find("checked in only one") != std::string::npos);
}

TEST_CASE("cells are matched by name; other work is not compared; nothing in common is said") {
  std::vector<CellResult> a = run(1), b = run(1);
  a.pop_back(), b.erase(b.begin());
  find(b, "bvh4")->facts["rays"] = 4000;
  const Comparison c = compare_results(a, b, {});
  CHECK(c.cells.size() == 5);
  CHECK(c.only_a == std::vector<std::string>{a.front().cell.name()});
  CHECK(c.only_b == std::vector<std::string>{b.back().cell.name()});
  REQUIRE(c.incomparable.size() == 1);
  CHECK(c.incomparable[0].second == "1000 rays in A, 4000 in B");
  CHECK(verdict(compare_results({a.front()}, {b.back()}, {})).first == ExitStatus::kNothingMeasured);
}

TEST_CASE("cells of other settings that stand in no name are other work, and only those that the setting concerns") {
  std::vector<CellResult> a = run(1), b = run(1);
  for (CellResult& r : b) slow_down(r, 2.0);
  const auto compared = [&](const CompareOptions& options) {
    std::map<std::string, std::string> why;
    const Comparison c = compare_results(a, b, options);
    for (const auto& [name, reason] : c.incomparable) why.emplace(name, reason);
    CHECK(c.other_settings == c.incomparable.size());
    CHECK(c.cells.size() + why.size() == a.size());
    return why;
  };
  const auto name = [](const char* structure, Cell::Metric metric = Cell::Metric::trace) {
    return cell_named(structure, metric).name();
  };
  CHECK(compared({}).empty());
  // Rows hold the parameters that they depend on; of one that only one of the two knows nothing can be said.
  const SettingDifference collapse{"parameters: collapse", "[sah]", "[greedy]"};
  const SettingDifference bins{"parameters: bins", "[4]", "[4, 64]"};
  CHECK(compared({.settings = {collapse, bins, {"measure: repetitions", "3", "7"}}}).empty());
  find(a, "bvh8")->facts["parameters"] = {{"bins", 16}, {"collapse", "sah"}, {"later", 1}};
  find(b, "bvh8")->facts["parameters"] = {{"bins", 16}, {"collapse", "greedy"}};
  CHECK(compared({.settings = {collapse}}) ==
        std::map<std::string, std::string>{{name("bvh8"), "collapse sah in A, greedy in B"}});
  CHECK(compared({.settings = {collapse}, .allow_different_settings = true}).empty());
  find(b, "bvh4")->facts["parameters"] = {{"bins", 16}};
  CHECK(compared({}).size() == 1);
  find(b, "bvh8")->facts["parameters"] = {{"bins", 32}, {"collapse", "sah"}};
  CHECK(compared({}).at(name("bvh8")) == "bins 16 in A, 32 in B");
  for (CellResult* r : {find(a, "bvh8"), find(b, "bvh8")}) r->facts["parameters"] = {{"bins", 16}};
  CHECK(compared({.settings = {{"measure: resolution", "[512, 256]", "[256, 512]"}}}).size() == 4);  // no builds
  // How rays leave surfaces is a fact of each row; the distance is told by the configuration.
  find(a, "bvh2")->facts["self_intersection"] = "none";
  find(b, "bvh2")->facts["self_intersection"] = "exclusion";
  CHECK(compared({}).at(name("bvh2")) == "self_intersection none in A, exclusion in B");
  CHECK(compared({.allow_different_settings = true}).empty());
  for (CellResult* r : {find(a, "bvh2"), find(b, "bvh2")}) r->facts["self_intersection"] = "epsilon";
  CHECK(compared({.settings = {{"rays: epsilon", "0.001", "0.01"}}}).size() == 1);
  find(b, "bvh8")->facts["parameters"] = {{"bins", 32}};
  const Comparison none = compare_results({*find(a, "bvh8")}, {*find(b, "bvh8")}, {.settings = {collapse}});
  CHECK(verdict(none).first == ExitStatus::kNothingMeasured);
  CHECK(comparison_text(none, false).find("(--allow-different-settings compares those") != std::string::npos);
  CHECK(Json::parse(comparison_json(none, {}, {}))["differences"][0] == "parameters: collapse: [sah] against [greedy]");
}

TEST_CASE("the settings by which two folders differ are read from their effective.yaml") {
  const Folder a, b;
  const char* yaml =
      "scenes:\n  - {{file: {}}}\naxes:\n  isa: [sse]\nparameters:\n  bins: [{}]\n{}rays: {{self_intersection: [{}]}}\n"
      "measure:\n  structure_cache: {}\n  repetitions: {}\n  resolution: [8, 8]\nmetrics: [trace]\n";
  (void)a.write("effective.yaml", fmt::format(fmt::runtime(yaml), "/here/x.obj", "4", "", "none", "/a", 3));
  (void)b.write("effective.yaml",
                fmt::format(fmt::runtime(yaml), "/there/x.obj", "4, 64", "  later: [1]\n", "none", "/b", 7));
  std::string text;
  for (const SettingDifference& d : setting_differences(a.path(), b.path())) text += d.text() + "; ";
  CHECK(text == "parameters: bins: [4] against [4, 64]; measure: repetitions: 3 against 7; ");
  CHECK(setting_differences(a.path(), a.path()).empty());
  CHECK(setting_differences(a.path(), a.path() / "nothing").empty());
  (void)b.write("effective.yaml", "measure: [");
  CHECK(setting_differences(a.path(), b.path()).empty());
}

TEST_CASE("a machine that was slower as a whole: a control takes it out, and embree's cells tell it") {
  std::vector<CellResult> a = run(1), b = run(900);
  a.push_back(measured(cell_named("embree"), 0.1, 0.02, 77)),
      b.push_back(measured(cell_named("embree"), 0.1, 0.02, 78));
  for (CellResult& r : b) slow_down(r, 1.2);
  slow_down(*find(b, "bvh8"), 1.2);
  const Comparison plain = compare_results(a, b, {});
  CHECK(plain.count(Verdict::slower) == plain.cells.size());
  CHECK(comparison_text(plain, false).find("the machine did") != std::string::npos);
  const Comparison relative = compare_results(a, b, {.control = "^trace/.*/embree/"});
  REQUIRE(relative.control_of_rays.has_value());
  CHECK(relative.control_of_rays->ratio.median == Approx(1.0 / 1.2).epsilon(0.03));
  CHECK(find(relative, "bvh2").verdict == Verdict::indistinguishable);
  CHECK(find(relative, "bvh8").verdict == Verdict::slower);
  CHECK(find(relative, "bvh8").ratio.median == Approx(1.0 / 1.2).epsilon(0.04));
  CHECK(error_of([&] { (void)compare_results(a, b, {.control = "nothing"}); }).find("finds no cell") !=
        std::string::npos);
  CHECK(error_of([&] { (void)compare_results(a, b, {.control = "("}); }).find("regular expression") !=
        std::string::npos);
}

TEST_CASE("a control is said to be of what it corrects: rays, builds or both") {
  const std::vector<CellResult> a = run(1);
  std::vector<CellResult> b = run(900);
  for (CellResult& r : b) slow_down(r, 1.2);
  for (const auto& [control, rays, builds] :
       {std::tuple{"^trace/.*/kdtree/", true, false}, {"^build/.*/kdtree/", false, true}, {"/kdtree/", true, true}}) {
    const Comparison c = compare_results(a, b, {.control = control});
    const std::string text = comparison_text(c, false);
    const auto says = [&](const std::string& part) { return text.find(part) != std::string::npos; };
    const Json json = Json::parse(comparison_json(c, {}, {}));
    INFO(text);
    for (const auto& [kind, trace, corrected] : {std::tuple{"rays", true, rays}, {"builds", false, builds}}) {
      CHECK(find(c, "bvh2", trace).verdict == (corrected ? Verdict::indistinguishable : Verdict::slower));
      CHECK(says(fmt::format("Speeds of {} are relative to the 1 {} of", kind, trace ? "trace" : "build")) ==
            corrected);
      CHECK(says(fmt::format("neither the interval nor p of {}: --control '{}' finds none", kind, control)) ==
            !corrected);
      CHECK(json["control"].contains(kind) == corrected);
      if (!corrected) continue;
      CHECK(json["control"][kind]["cells"] == 1);
      CHECK(json["control"][kind]["ratio"]["median"].get<double>() == Approx(1.0 / 1.2).epsilon(0.03));
    }
    for (const auto& [title, corrected] :
         {std::pair{"A Mray/s", rays}, {"A ms", builds}, {"geometric mean", rays && builds}}) {
      const std::string line = text.substr(text.find(title), text.find('\n', text.find(title)) - text.find(title));
      CHECK((line.find("B/A over control's") != std::string::npos) == corrected);
    }
    CHECK_FALSE(says("All speeds"));
    CHECK_FALSE(says("takes it out"));
  }
}

TEST_CASE("what speaks for a busy machine is told: loads that differ, a warning of noise, drift") {
  ResultFolder a, b;
  a.context = {{"load", "0.10 0.20 0.30 1/99 1234"}}, b.context = {{"load", "0.45 0.20 0.30 1/99 1234"}};
  CHECK(origins_text(a, b).find("load") == std::string::npos);
  b.context = {{"load", "3.45 0.20 0.30 1/99 1234"},
               {"warnings", {"noisy machine: the repetitions spread", "no avx512"}}};
  const std::string text = origins_text(a, b);
  CHECK(text.find("differs: load average at the start: 0.10 against 3.45\n") != std::string::npos);
  CHECK(text.find("B warned: noisy machine: the repetitions spread\n") != std::string::npos);
  CHECK(text.find("no avx512") == std::string::npos);
  CHECK(origins_text({}, {}).find("load") == std::string::npos);
  const Comparison c = compare_results(run(1), run(900), {});
  CHECK(comparison_text(c, false).find("Drift of the machine between the two runs is in neither the interval nor p") !=
        std::string::npos);
  CHECK(comparison_text(compare_results(run(1), run(900), {.control = "kdtree"}), false).find("Drift") ==
        std::string::npos);
}

TEST_CASE("means are those of their cells, whatever the order they are summed in") {
  std::vector<CellResult> a = run(1), b = run(900);
  slow_down(*find(b, "bvh8"), 1.25);
  for (const std::string control : {"", "/kdtree/"}) {
    const Comparison c = compare_results(a, b, {.control = control});
    REQUIRE(c.means.size() == 6);  // rays, four structures, builds
    CHECK((c.means.front().value == "rays" && c.means.back().value == "builds"));
    double logs = 0.0;
    for (const ComparedCell& cell : c.cells) {
      if (!cell.is_trace()) continue;
      logs += std::log(cell.ratio.median) / 4;
      const auto mean = std::ranges::find(c.means, cell.a.cell.structure, &MeanRatio::value);
      REQUIRE(mean != c.means.end());
      CHECK(mean->ratio.median == Approx(cell.ratio.median));
      CHECK(mean->ratio.low == Approx(cell.ratio.low));
      CHECK(mean->ratio.high == Approx(cell.ratio.high));
    }
    CHECK(c.means.front().ratio.median == Approx(std::exp(logs)));
    CHECK(c.means.front().ratio.low < c.means.front().ratio.median);
    CHECK(c.means.front().cells == 4);
    CHECK(c.means.front().slower ==
          static_cast<std::size_t>(std::ranges::count_if(
              c.cells, [](const ComparedCell& cell) { return cell.is_trace() && cell.verdict == Verdict::slower; })));
  }
}

TEST_CASE("the comparison as JSON and CSV") {
  const std::vector<CellResult> a = run(1);
  const Comparison c = compare_results(a, run(900), {});
  const Json json = Json::parse(comparison_json(c, {}, {}));
  REQUIRE(json["cells"].size() == 8);
  CHECK(json["cells"][0]["name"] == a.front().cell.name());
  CHECK(json["cells"][0]["ratio"].get<double>() == c.cells[0].ratio.median);
  CHECK(json["exit_status"] == 0);
  const std::string csv = comparison_csv(c);
  CHECK(csv.starts_with("name,metric,scene,structure"));
  CHECK(std::ranges::count(csv, '\n') == 9);
}
