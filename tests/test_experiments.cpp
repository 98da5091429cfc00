// From a configuration to the cells of a sweep: the product, includes, what is skipped, filters, the estimate.
#include <fmt/format.h>

#include <map>
#include <numeric>

#include "experiments/config.h"
#include "experiments/effective.h"
#include "experiments/estimate.h"
#include "experiments/plan.h"
#include "tests/catch.h"
#include "tests/experiments_on_paper.h"

using namespace arboretum;
using namespace arboretum::test;

TEST_CASE("cells are the product, in names that docs/results.md fixes; auto follows the rest") {
  const Folder folder;
  const Registry registry = paper_registry();
  const Plan plan = planned(folder, registry, R"(
scenes: [{generate: sphere, triangles: 500}]
axes:
  structure: [tree]
  intersector: [moller_trumbore, watertight]
  traversal: [single, packet]
  isa: [sse, avx2]
  workload: [primary, shadow]
)");
  const auto traces = names(plan, Cell::Metric::trace);
  CHECK(traces.size() == 16);
  const auto has = [&](const std::string& name) { return std::ranges::find(traces, name) != traces.end(); };
  CHECK(has("trace/sphere-500/tree/binned_sah/triangle4/moller_trumbore/fast/single/sse/primary/threads:1"));
  CHECK(has("trace/sphere-500/tree/binned_sah/triangle8/watertight/padded/packet8/avx2/shadow/threads:1"));
  const auto builds = names(plan, Cell::Metric::build);
  REQUIRE(builds.size() == 2);
  CHECK(builds[0] == "build/sphere-500/tree/binned_sah/triangle4/-/-/-/sse/-/threads:1");
  CHECK(builds[1] == "build/sphere-500/tree/binned_sah/triangle8/-/-/-/avx2/-/threads:1");
  CHECK(plan.skipped.empty());
}

TEST_CASE("what cannot be is skipped with its reason, and an ISA that is lacking is never replaced") {
  const Folder folder;
  const Registry registry = paper_registry();
  const Plan plan = planned(folder, registry, R"(
scenes: [{generate: sphere, triangles: 500}]
axes:
  structure: [tree, list, embree]
  builder: [binned_sah, none]
  intersector: [moller_trumbore, watertight]
  isa: [sse, avx512]
)");
  CHECK(names(plan, Cell::Metric::trace).size() == 3);
  CHECK(plan.skipped.size() == 24 - 3);
  std::map<std::string, std::size_t> reasons;
  for (const auto& [reason, count] : group_reasons(plan.skipped)) reasons[reason] = count;
  CHECK(reasons["no avx512"] == 3);
  CHECK(reasons["list has no watertight"] == 2);
  CHECK(reasons["tree has no builder none (it takes binned_sah, morton)"] == 4);
  CHECK(reasons["this build has no embree: install libembree-dev and build again"] == 8);
}

TEST_CASE("of a sweep that traces nothing builds are skipped and excluded, each once, and none that is measured") {
  const Folder folder;
  const Registry registry = paper_registry();
  const fs::path file = folder.write("builds.yaml", R"(
scenes: [{generate: sphere, triangles: 500}]
axes:
  structure: [tree, list]
  builder: [binned_sah, none]
  leaf: [triangle4]
  intersector: [watertight, moller_trumbore]
  isa: [sse, avx512]
  workload: [primary, shadow]
exclude: [{structure: tree, intersector: watertight}, {structure: list, builder: binned_sah, isa: sse}]
metrics: [build]
)");
  const auto name = [](const char* structure, const char* builder, const char* isa) {
    return fmt::format("build/sphere-500/{}/{}/triangle4/-/-/-/{}/-/threads:1", structure, builder, isa);
  };
  const Plan plan = make_plan(read_experiment(file, registry), registry);
  CHECK(names(plan, Cell::Metric::build) ==
        std::vector{name("tree", "binned_sah", "sse"), name("list", "none", "sse")});
  std::map<std::string, std::string> skipped;
  for (const SkippedCell& cell : plan.skipped) CHECK(skipped.emplace(cell.name, cell.reason).second);
  const std::string tree_has_none = "tree has no builder none (it takes binned_sah, morton)";
  CHECK(skipped == std::map<std::string, std::string>{
                       {name("tree", "binned_sah", "avx512"), "no avx512"},
                       {name("tree", "none", "sse"), tree_has_none},
                       {name("tree", "none", "avx512"), tree_has_none},
                       {name("list", "binned_sah", "avx512"), "list has no builder binned_sah (it takes none)"},
                       {name("list", "none", "avx512"), "no avx512"}});
  CHECK(plan.excluded == 1);  // binned_sah of the list by SSE; moller_trumbore takes what watertight does of the tree
  CHECK(plan.elsewhere.size() == 2);
  for (const Cell& cell : plan.elsewhere) CHECK(skipped[cell.name()] == "no avx512");
}

TEST_CASE("builder all is each that the structure takes, a named one not twice") {
  Folder folder;
  const Registry registry = paper_registry();
  const auto cells = [&](const std::string& axes) {
    const fs::path file = folder.write("all.yaml", "scenes: [{generate: sphere, triangles: 500}]\naxes: {" + axes +
                                                       ", isa: [sse], intersector: [moller_trumbore]}\n");
    std::string builders;
    for (const Cell& cell : make_plan(read_experiment(file, registry), registry).cells)
      if (cell.metric == Cell::Metric::trace) builders += cell.structure + ":" + cell.builder + " ";
    return builders;
  };
  CHECK(cells("structure: [tree, list], builder: [all]") == "tree:binned_sah tree:morton list:none ");
  CHECK(cells("structure: [tree], builder: [morton, all]") == "tree:morton tree:binned_sah ");
}

TEST_CASE(
    "an optional scene that is not there has its cells skipped with the reason; ARBORETUM_SCENES is where it may be") {
  Folder folder;
  const Registry registry = paper_registry();
  const fs::path file = folder.write("optional.yaml",
                                     "scenes: [{file: away/far.obj, optional: true}, {generate: sphere, triangles: "
                                     "500}]\naxes: {structure: [tree], isa: [sse]}\n");
  ::unsetenv("ARBORETUM_SCENES");
  const auto plan_now = [&] { return make_plan(read_experiment(file, registry), registry); };
  Plan plan = plan_now();
  REQUIRE(plan.skipped.size() == 1);
  CHECK(plan.skipped[0].name.find("trace/far/tree/") == 0);
  CHECK(plan.skipped[0].reason ==
        "optional scene away/far.obj is not here: ARBORETUM_SCENES, the folder to find it in, is not set");
  CHECK(plan.cells.size() == 2);
  CHECK(effective_yaml(read_experiment(file, registry)).find("{file: away/far.obj, optional: true}") !=
        std::string::npos);
  const std::string without = configuration_hash(read_experiment(file, registry));
  const fs::path scenes = folder.path() / "scenes";
  ::setenv("ARBORETUM_SCENES", scenes.c_str(), 1);
  CHECK(plan_now().skipped.at(0).reason ==
        "optional scene away/far.obj is not here: ARBORETUM_SCENES is " + scenes.string());
  fs::create_directories(scenes / "away");
  folder.write("scenes/away/far.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  CHECK(plan_now().skipped.empty());
  CHECK(plan_now().cells.size() == 4);
  // Where a file is, and whether, is no other sweep: parts of it may be measured on machines that differ in that.
  CHECK(configuration_hash(read_experiment(file, registry)) == without);
  ::unsetenv("ARBORETUM_SCENES");
}

TEST_CASE("include adds cells with the sweep's values where they apply, exclude takes cells away") {
  const Folder folder;
  const Registry registry = paper_registry();
  const Plan plan = planned(folder, registry, R"(
scenes: [{generate: sphere, triangles: 500}]
axes:
  structure: [tree]
  builder: [binned_sah, morton]
  leaf: [triangle8]
  intersector: [moller_trumbore]
  isa: [scalar, sse]
include: [{structure: list}, {structure: tree, builder: morton, box: [padded]}]
exclude: [{builder: morton, isa: sse, box: fast}]
metrics: [trace]
)");
  CHECK(names(plan, Cell::Metric::trace) ==
        std::vector<std::string>{
            "trace/sphere-500/tree/binned_sah/triangle8/moller_trumbore/fast/single/scalar/primary/threads:1",
            "trace/sphere-500/tree/binned_sah/triangle8/moller_trumbore/fast/single/sse/primary/threads:1",
            "trace/sphere-500/tree/morton/triangle8/moller_trumbore/fast/single/scalar/primary/threads:1",
            "trace/sphere-500/list/none/triangle4/moller_trumbore/fast/single/scalar/primary/threads:1",
            "trace/sphere-500/list/none/triangle4/moller_trumbore/fast/single/sse/primary/threads:1",
            "trace/sphere-500/tree/morton/triangle8/moller_trumbore/padded/single/scalar/primary/threads:1",
            "trace/sphere-500/tree/morton/triangle8/moller_trumbore/padded/single/sse/primary/threads:1"});
  CHECK(plan.excluded == 1);
  CHECK(names(plan, Cell::Metric::build).empty());
}

TEST_CASE("an include without a structure is of the sweep's structures that take what it names") {
  const Folder folder;
  const Registry registry = paper_registry();
  const std::string sweep =
      "scenes: [{generate: sphere, triangles: 500}]\naxes: {structure: [tree, list], intersector: moller_trumbore, "
      "isa: "
      "sse}\nmetrics: [trace]\nexclude: []\n";
  const auto added = [&](const std::string& include) {
    return names(make_plan(read_experiment(folder.write("plan.yaml", sweep + include), registry), registry),
                 Cell::Metric::trace);
  };
  CHECK(added("include: []").size() == 2);
  CHECK(added("include: [{builder: morton}]").size() == 3);  // list has no morton
  const std::vector<std::string> more = added("include: [{isa: scalar}]");
  REQUIRE(more.size() == 4);
  CHECK(more[3].find("/list/none/triangle4/moller_trumbore/fast/single/scalar/") != std::string::npos);
}

TEST_CASE(
    "axes of the command line hold for includes too; what is left without a cell is told, as what exclude takes") {
  const Folder folder;
  const Registry registry = paper_registry();
  const fs::path file = folder.write("plan.yaml", R"(scenes: [{generate: sphere, triangles: 500}]
axes: {structure: [tree], intersector: moller_trumbore, isa: [scalar, sse, avx2]}
include:
  - {structure: list, isa: [sse, avx2]}
  - {structure: tree, builder: morton, isa: avx2}
exclude: [{structure: list, isa: sse}]
metrics: [trace]
)");
  const auto read = [&](std::vector<std::string> axes) {
    return read_experiment(file, registry, {.axes = std::move(axes)});
  };
  CHECK(names(make_plan(read({}), registry), Cell::Metric::trace).size() == 5);
  const Experiment one = read({"isa=sse"});
  const Plan plan = make_plan(one, registry);
  REQUIRE(names(plan, Cell::Metric::trace).size() == 1);
  REQUIRE(one.left_out.size() == 1);
  CHECK(one.left_out[0].find("plan.yaml:5: this include is left out: the command line names no isa of it") !=
        std::string::npos);
  REQUIRE(plan.excluded_includes.size() == 1);
  CHECK(plan.excluded_includes[0].find("/list/none/triangle4/moller_trumbore/fast/single/sse/") != std::string::npos);
  CHECK(plan.excluded_includes[0].find("plan.yaml:6 takes away what ") != std::string::npos);
  // What an include is there for stays
  CHECK(read({"structure=tree"}).left_out.empty());
  CHECK(names(make_plan(read({"structure=tree"}), registry), Cell::Metric::trace).size() == 5);
}

TEST_CASE(
    "ways of leaving a surface are part of the cell where several are swept, of workloads that start on surfaces") {
  const Folder folder;
  const Registry registry = paper_registry();
  const auto plan_of = [&](const std::string& ways) {
    const fs::path file =
        folder.write("rays.yaml",
                     "scenes: [{generate: sphere, triangles: 500}]\naxes: {structure: [tree], isa: [sse], intersector: "
                     "[moller_trumbore], workload: [primary, diffuse]}\nrays: {self_intersection: " +
                         ways + "}\nmetrics: [trace]\n");
    const Experiment experiment = read_experiment(file, registry);
    const fs::path again = folder.write("again.yaml", effective_yaml(experiment));
    CHECK(effective_yaml(read_experiment(again, registry)) == effective_yaml(experiment));
    return make_plan(experiment, registry);
  };
  const Plan swept = plan_of("[none, epsilon], epsilon: 0.001");
  CHECK(names(swept, Cell::Metric::trace) ==
        std::vector<std::string>{
            "trace/sphere-500/tree/binned_sah/triangle4/moller_trumbore/fast/single/sse/primary/threads:1",
            "trace/sphere-500/tree/binned_sah/triangle4/moller_trumbore/fast/single/sse/diffuse:self_intersection=none/"
            "threads:1",
            "trace/sphere-500/tree/binned_sah/triangle4/moller_trumbore/fast/single/sse/"
            "diffuse:self_intersection=epsilon/threads:1"});
  CHECK(swept.cells[2].start.epsilon == 0.001);
  const Plan one = plan_of("exclusion");
  REQUIRE(one.cells.size() == 2);
  CHECK(one.cells[1].workload_name() == "diffuse");
  CHECK(one.cells[1].start.method == SelfIntersection::exclusion);
}

TEST_CASE("placed scenes: a cell for each place, named by it; a choice may name them all") {
  const Folder folder;
  const Registry registry = paper_registry();
  const fs::path file = folder.write("placed.yaml", R"(
scenes: [{generate: sphere, triangles: 500, size: 100, offset: [1, 1e4]}, {generate: sphere, triangles: 600, stretch: 10}]
axes: {structure: [tree], isa: [sse], intersector: [moller_trumbore], workload: [primary, random]}
exclude: [{scene: sphere-500, workload: random}, {scene: "sphere-500:size=100:offset=1e4", workload: primary}]
metrics: [trace]
)");
  const Experiment experiment = read_experiment(file, registry);
  std::vector<std::string> found;
  for (const Cell& cell : make_plan(experiment, registry).cells) found.push_back(cell.scene + " " + cell.workload);
  CHECK(found == std::vector<std::string>{"sphere-500:size=100:offset=1 primary", "sphere-600:stretch=10 primary",
                                          "sphere-600:stretch=10 random"});
  CHECK(experiment.scenes[1].placing.offset == 1e4);
  const Experiment again = read_experiment(folder.write("again.yaml", effective_yaml(experiment)), registry);
  CHECK(effective_yaml(again) == effective_yaml(experiment));
  CHECK(again.scenes[1].placing.size == 100);
  CHECK(read_experiment(file, registry, {.axes = {"scene=sphere-500"}}).scenes.size() == 2);
}

TEST_CASE("swept builder parameters are part of the cell where the builder reads them") {
  const Folder folder;
  const Registry registry = paper_registry();
  const Plan plan = planned(folder, registry, R"(
scenes: [{generate: sphere, triangles: 500}]
axes: {structure: [tree, list], isa: [sse], intersector: [moller_trumbore]}
parameters: {bins: [8, 16], collapse: greedy}
metrics: [trace]
)");
  REQUIRE(plan.cells.size() == 3);
  CHECK(plan.cells[0].builder_name() == "binned_sah:bins=8");
  CHECK(plan.cells[0].parameters.bins == 8);
  CHECK(plan.cells[1].parameters.bins == 16);
  CHECK(plan.cells[1].parameters.collapse == "greedy");
  CHECK(plan.cells[2].builder_name() == "none");
}

TEST_CASE("a parameter multiplies and names the cells that read it, and no others; one that none reads is refused") {
  const Folder folder;
  Registry registry = paper_registry();
  using Names = std::vector<std::string_view>;
  registry.parameters_read = [](std::string_view structure, std::string_view builder,
                                std::string_view) -> std::optional<Names> {
    if (structure != "tree") return std::nullopt;
    return builder == "morton" ? Names{"morton_bits"} : Names{"bins", "collapse"};
  };
  const auto builders = [&](const std::string& axes, const std::string& parameters, const Overrides& overrides = {}) {
    const fs::path file =
        folder.write("plan.yaml",
                     "scenes: [{generate: sphere, triangles: 500}]\naxes: {structure: [tree, list], isa: [sse], "
                     "intersector: [moller_trumbore], " +
                         axes + "}\nparameters: {" + parameters + "}\nmetrics: [trace]\n");
    std::vector<std::string> list;
    for (const Cell& cell : make_plan(read_experiment(file, registry, overrides), registry).cells)
      list.push_back(cell.builder_name());
    return list;
  };
  using List = std::vector<std::string>;
  CHECK(builders("builder: [all]", "bins: [8, 16], morton_bits: [30, 63]") ==
        List{"binned_sah:bins=8", "binned_sah:bins=16", "morton:morton_bits=30", "morton:morton_bits=63", "none"});
  CHECK(builders("builder: [all]", "collapse: [greedy, optimal]") ==
        List{"binned_sah:collapse=greedy", "binned_sah:collapse=optimal", "morton", "none"});
  for (const std::string parameters :
       {"ploc_radius: [3, 4]", "ploc_radius: 3", "max_depth: 5", "grid_density: 2", "below: bvh4"}) {
    const std::string error = error_of([&] { builders("builder: [all]", parameters); });
    INFO(parameters << ": " << error);
    CHECK(error.find("plan.yaml:3: " + parameters.substr(0, parameters.find(':')) + " has no effect") !=
          std::string::npos);
  }
  CHECK(error_of([&] { builders("builder: [binned_sah]", "morton_bits: 30"); }).find("only morton (tree)") !=
        std::string::npos);
  // Asking for a default is no error (effective.yaml names them all), nor is an axis that the command line takes away
  // from a parameter.
  CHECK(builders("builder: [binned_sah]", "max_depth: 0, ploc_radius: 16, morton_bits: 63") == List{"binned_sah"});
  CHECK(builders("builder: [all]", "morton_bits: [30, 63]", {.axes = {"builder=binned_sah"}}) == List{"binned_sah"});
}

TEST_CASE("filters keep and drop by name; a broken expression is named") {
  const Folder folder;
  const Registry registry = paper_registry();
  const fs::path file = folder.write("small.yaml", kSmall);
  Plan plan = make_plan(read_experiment(file, registry, {.axes = {"isa=scalar,sse,avx2"}}), registry);
  CHECK(plan.cells.size() == 6);
  apply_filter(plan, "^trace/", "/avx2/");
  CHECK(plan.cells.size() == 2);
  CHECK(plan.filtered == 4);
  CHECK(error_of([&] { apply_filter(plan, "(", ""); }).find("no regular expression") != std::string::npos);
  CHECK(error_of([&] { apply_filter(plan, "(a)\\1", ""); }).find("references to groups") != std::string::npos);
  CHECK(error_of([&] { apply_filter(plan, std::string(2001, 'a'), ""); }).find("too long") != std::string::npos);
  CHECK(error_of([&] { apply_filter(plan, std::string(2000, '('), ""); }).find("check brackets") != std::string::npos);
  CHECK(error_of([&] { apply_filter(plan, "(?=.*(?=.*(?!.*b)))", ""); }).find("looks ahead") != std::string::npos);
  apply_filter(plan, "", "(((((.*)*)*)*)*)*~");  // without backtracking: at once
}

TEST_CASE("what is skipped is filtered as well") {
  const Folder folder;
  const Registry registry = paper_registry();
  const fs::path file = folder.write("small.yaml", kSmall);
  Plan plan =
      make_plan(read_experiment(file, registry, {.axes = {"isa=sse,avx2,avx512", "structure=tree,list"}}), registry);
  REQUIRE(plan.skipped.size() == 2);  // this machine has no avx512
  apply_filter(plan, "/tree/", "");
  REQUIRE(plan.skipped.size() == 1);
  CHECK(plan.skipped[0].name.find("/tree/") != std::string::npos);
  apply_filter(plan, "", "avx512");
  CHECK(plan.skipped.empty());
}

TEST_CASE("a cell is excluded once, however many values of what it does not read are swept") {
  const Folder folder;
  const Registry registry = paper_registry();
  const Plan plan = make_plan(read_experiment(folder.write("small.yaml", R"(
scenes: [{generate: sphere, triangles: 500}]
axes: {structure: [tree, list], isa: [sse], intersector: [moller_trumbore]}
parameters: {bins: [8, 16, 32, 64]}
exclude: [{structure: list}]
metrics: [trace]
)"),
                                              registry),
                              registry);
  CHECK(plan.cells.size() == 4);
  CHECK(plan.excluded == 1);
}

TEST_CASE("an estimate leaves out repetitions that were measured") {
  const Folder folder;
  const Registry registry = paper_registry();
  const Experiment experiment = read_experiment(folder.write("small.yaml", kSmall), registry);
  const Plan plan = make_plan(experiment, registry);
  const std::vector<double> whole = estimate_seconds(experiment, plan.cells),
                            none = estimate_seconds(experiment, plan.cells, [](const Cell&) { return 0; }),
                            some = estimate_seconds(experiment, plan.cells, [](const Cell&) { return 5; });
  REQUIRE(whole.size() == 2);
  CHECK(whole == none);
  // Builds of 500 triangles fill the 20 ms that are enough; a pass is 262144 rays at ten million a second.
  const double pass = 0.0262144;
  const MeasureSettings& m = experiment.measure;
  CHECK(whole[0] - some[0] == Approx(5 * std::min(m.min_time, 0.02)));
  CHECK(whole[1] - some[1] == Approx(5 * (std::max(m.min_time, pass) + 0.625 * pass)));
}

TEST_CASE("an estimate counts what cells need once, once, and what each cell needs besides its repetitions") {
  const Folder folder;
  const Registry registry = paper_registry();
  const auto seconds = [&](const std::string& axes, const std::string& more = "") {
    const Experiment experiment = read_experiment(
        folder.write("some.yaml", "scenes: [sphere:1000000]\naxes: {isa: [sse], " + axes +
                                      "}\nmeasure: {repetitions: 1, warmup: 0, min_time: 0, resolution: [1000, 1000]" +
                                      more + "}\nmetrics: [trace]\n"),
        registry);
    const std::vector<double> each = estimate_seconds(experiment, make_plan(experiment, registry).cells);
    return std::pair{each.size(), std::accumulate(each.begin(), each.end(), 0.0)};
  };
  const std::string one = "structure: [tree], builder: [binned_sah], intersector: [watertight]";
  const auto [cells, first] = seconds(one + ", workload: [primary]");
  REQUIRE(cells == 1);
  // Four seconds of loading, one of exact answers, a quarter of building, 6.625 passes of a tenth of a second
  CHECK(first == Approx(4.0 + 1.0 + 0.25 + 0.6625));
  const auto [of_two, second] = seconds(one + ", workload: [primary, diffuse]");
  REQUIRE(of_two == 2);
  CHECK(second - first == Approx(2.0 + 0.6625));  // exact answers of two kinds, and passes
  CHECK(seconds(one + ", workload: [primary]", ", min_warmup_time: 3").second == Approx(first + 3.0));
}
