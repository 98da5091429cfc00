// What a configuration may say: its faults, words, ends of limits, and what is written of it as a whole.
#include "experiments/axis_words.h"
#include "experiments/config.h"
#include "experiments/effective.h"
#include "experiments/parameters.h"
#include "experiments/plan.h"
#include "tests/catch.h"
#include "tests/experiments_on_paper.h"

using namespace arboretum;
using namespace arboretum::test;

TEST_CASE("every fault of a configuration is one line with file, line and the nearest word") {
  const Folder folder;
  const Registry registry = paper_registry();
  struct Case {
    const char* yaml;
    const char* line;      ///< "name.yaml:2" or ""
    const char* expected;  ///< part of the message
  };
  const Case cases[] = {
      {"", "", "empty"},
      {"scenes:\n\t- bunny\n", ":2", "a tab"},
      {"scenes: [bunny\n", "", "not valid YAML"},
      {"scenes: [bunny]\n---\nscenes: [bunny]\n", "", "2 YAML documents"},
      {"scenes: [bunny]\naxis: {}\n", ":2", "did you mean 'axes'"},
      {"axes: {structure: [tree]}\n", ":1", "no scenes"},
      {"scenes: []\n", ":1", "scenes is empty"},
      {"scenes: [buny]\n", ":1", "did you mean 'bunny'"},
      {"scenes: [bunny, bunny]\n", ":1", "given twice"},
      {"scenes: [bunny]\naxes: {threads: [1, 1.0]}\n", ":2", "'1.0' is given twice"},
      {"scenes: [{file: nowhere.obj}]\n", ":1", "is no file"},
      {"scenes: [{file: nowhere.obj, optional: maybe}]\n", ":1", "true or false"},
      {"scenes: [{generate: sphere, optional: true}]\n", ":1", "no effect with generate"},
      {"scenes: [{generate: sphere_flak}]\n", ":1", "did you mean 'sphere_flake'"},
      {"scenes: [{generate: sphere, triangles: 0}]\n", ":1", "triangles must be an integer"},
      {"scenes: [{file: a.obj, generate: sphere}]\n", ":1", "exactly one of"},
      {"scenes: [bunny]\naxes:\n  structur: [tree]\n", ":3", "did you mean 'structure'"},
      {"scenes: [bunny]\naxes:\n  structure: [tre]\n", ":3", "did you mean 'tree'"},
      {"scenes: [bunny]\naxes:\n  structure: []\n", ":3", "is empty"},
      {"scenes: [bunny]\naxes:\n  structure:\n", ":3", "has no value"},
      {"scenes: [bunny]\naxes:\n  structure: [tree, tree]\n", ":3", "given twice"},
      {"scenes: [bunny]\naxes:\n  isa: [avx, avx2]\n", ":3", "given twice"},
      {"scenes: [bunny]\naxes:\n  isa: [avx1024]\n", ":3", "did you mean"},
      {"scenes: [bunny]\naxes:\n  isa: [AVX2]\n", ":3", "did you mean 'avx2'"},
      {"scenes: [bunny]\naxes:\n  workload: [difuse]\n", ":3", "did you mean 'diffuse'"},
      {"scenes: [bunny]\naxes:\n  threads: [-1]\n", ":3", "threads must be an integer"},
      {"scenes: [bunny]\naxes:\n  traversal: [hybrid]\n", ":3", "unknown traversal"},
      {"scenes: [bunny]\nmeasure: {resolution: [0, 512]}\n", ":2", "resolution: width must be an integer from 1"},
      {"scenes: [bunny]\nmeasure: {resolution: 512}\n", ":2", "[width, height]"},
      {"scenes: [bunny]\nmeasure: {repetitions: -3}\n", ":2", "repetitions must be an integer"},
      {"scenes: [bunny]\nmeasure: {repetitions: 2.5}\n", ":2", "repetitions must be an integer"},
      {"scenes: [bunny]\nmeasure: {repetitions: aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaüü}\n", ":2",
       "not 'aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa... (61 characters)'"},
      {"scenes: [bunny]\nmeasure: {min_time: nan}\n", ":2", "min_time (seconds) must be a number"},
      {"scenes: [bunny]\nmeasure: {memory: 8GB}\n", ":2", "8GiB"},
      {"scenes: [bunny]\nmeasure: {memory: 0GiB}\n", ":2", "must be a size of 1MiB and more"},
      {"scenes: [bunny]\nmeasure: {memory: 8}\n", ":2",
       "must be a size of 1MiB and more, such as 8GiB or 512MiB, not '8'"},
      {"scenes: [bunny]\nmeasure: {memory: 99999999999999GiB}\n", ":2",
       "memory must be a size below 1048576TiB, not 9999"},
      {"scenes: [bunny]\nmeasure: {repetition: 3}\n", ":2", "did you mean 'repetitions'"},
      {"scenes: [bunny]\nmeasure: {seed: 1, seed: 2}\n", ":2", "given twice"},
      {"scenes: [bunny]\naxes: {threads: [2]}\nmeasure: {threads: 1}\n", ":3", "axes too"},
      {"scenes: [bunny]\nmetrics: [trase]\n", ":2", "did you mean 'trace'"},
      {"scenes: [bunny]\nmetrics: [build, accuracy]\n", ":2", "no effect without trace"},
      {"scenes: [bunny]\nplots: [rays]\n", ":2", "unknown plot 'rays'"},
      {"scenes: [bunny]\nmetrics: [trace]\nplots: [sah_cost]\n", ":3", "has no data"},
      {"scenes: [bunny]\nmetrics: [build]\nplots: [leaf_histograms]\n", ":3", "has no data"},
      {"scenes: [bunny]\nmetrics: [trace, quality]\nplots: [leaf_histograms, build_phases]\n", ":3",
       "plot build_phases has no data: it takes build in `metrics`"},
      {"scenes: [bunny]\nmetrics: [trace, quality]\nplots: [memory_vs_time, visits_per_ray, build_vs_trace]\n", ":3",
       "plot build_vs_trace has no data"},
      {"scenes: [bunny]\nmetrics: [build]\nplots: [build_time, memory_vs_time]\n", ":3",
       "plot memory_vs_time has no data"},
      {"scenes: [bunny]\nmetrics: [build]\nplots: [build_time, visits_per_ray]\n", ":3",
       "plot visits_per_ray has no data"},
      {"scenes: [bunny]\nparameters: {bins: 1000}\n", ":2", "bins must be an integer from 4 to 64"},
      {"scenes: [bunny]\nparameters: {max_leaf_blocks: 9}\n", ":2", "max_leaf_blocks must be an integer from 1 to 8"},
      {"scenes: [bunny]\nparameters: {morton_bits: 31}\n", ":2", "morton_bits must be one of 30, 63"},
      {"scenes: [bunny]\nparameters: {colapse: greedy}\n", ":2", "did you mean 'collapse'"},
      {"scenes: [bunny]\naxes: {workload: [diffuse]}\nrays: {self_intersection: [nome]}\n", ":3",
       "did you mean 'none'"},
      {"scenes: [bunny]\naxes: {workload: [diffuse]}\nrays: {self_intersection: []}\n", ":3", "is empty"},
      {"scenes: [bunny]\naxes: {workload: [diffuse]}\nrays: {self_intersection: [none, none]}\n", ":3", "given twice"},
      {"scenes: [bunny]\naxes: {workload: [diffuse]}\nrays: {self_intersections: [none]}\n", ":3",
       "did you mean 'self_intersection'"},
      {"scenes: [bunny]\naxes: {workload: [diffuse]}\nrays: {self_intersection: [epsilon], epsilon: 2}\n", ":3",
       "epsilon (a share of the scene's diagonal) must be"},
      {"scenes: [bunny]\naxes: {workload: [diffuse]}\nrays: {epsilon: 1e-3}\n", ":3",
       "no effect without self_intersection: epsilon"},
      {"scenes: [bunny]\naxes: {workload: [primary]}\nrays: {self_intersection: [none]}\n", ":3", "rays has no effect"},
      {"scenes: [{generate: sphere, offset: [1, 1]}]\n", ":1", "given twice"},
      {"scenes:\n  - {generate: sphere_flake, seed: 2}\n", ":2", "seed: 2 would change nothing"},
      {"scenes:\n  - {generate: sphere_flake, triangles: 1000000000}\n", ":2", "is not within 1 to 500000000"},
      {"scenes: [{generate: sphere, offset: far}]\n", ":1", "offset must be a number"},
      {"scenes: [{generate: sphere, stretch: 0}]\n", ":1", "stretch must be a number"},
      {"scenes: [{generate: sphere, ofset: 1}]\n", ":1", "did you mean 'offset'"},
      {"scenes: [{catalogue: buny, offset: 1}]\n", ":1", "did you mean 'bunny'"},
      {"scenes: [{catalogue: bunny, triangles: 100}]\n", ":1", "no effect without generate"},
      {"scenes: [bunny]\nmetrics: [trace, accuracy]\nplots: [leak_picture]\n", ":3",
       "leak_picture has no data: it shows the workload camera_edges"},
      {"scenes: [bunny]\ninclude: [{builder: nought}]\n", ":2", "unknown builder"},
      {"scenes: [bunny]\nmeasure: {<<: {}, seed: 1}\n", ":2", "merge keys (<<) are not read"},
      {"scenes: [bunny]\nexclude: {structure: tree}\n", ":2", "must be a list of maps"},
      {"scenes: [bunny]\nexclude: [{scene: dragon}]\n", ":2", "unknown scene"},
      {"scenes: [bunny]\nexperiment: ../up\n", ":2", "names a folder"},
      {"scenes: [{generate: sphere, triangles: 500}]\naxes: {structure: [tree], isa: [sse]}\nexclude: [{isa: "
       "avx512}]\n",
       ":3", "takes no cell away"},
      {"scenes: [{generate: sphere, triangles: 500}]\naxes: {structure: [tree], isa: [sse]}\ninclude: "
       "[{structure: tree}]\n",
       ":3", "adds no cell"},
  };
  for (const Case& c : cases) {
    const fs::path file = folder.write("case.yaml", c.yaml);
    const std::string message = error_of([&] { (void)make_plan(read_experiment(file, registry), registry); });
    INFO(c.yaml << "\n-> " << message);
    CHECK(message.find(c.expected) != std::string::npos);
    CHECK(message.starts_with((file.string() + c.line)));
  }
  CHECK(error_of([&] { (void)read_experiment(folder.path() / "none.yaml", registry); }).find("no such file") !=
        std::string::npos);
  CHECK(error_of([&] { (void)read_experiment(folder.path(), registry); }).find("is a folder") != std::string::npos);
}

TEST_CASE("scenes may be words, as on the command line") {
  const Folder folder;
  const Registry registry = paper_registry();
  const fs::path model = folder.write("ring.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  folder.write("room.yaml", "models: [{file: ring.obj}]\n");
  const auto read = [&](const std::string& scenes) {
    return read_experiment(folder.write("words.yaml", "scenes: " + scenes + "\n"), registry);
  };
  const Experiment experiment = read("[ring.obj, room.yaml, sphere:500, 'needles:500:2', sphere]");
  REQUIRE(experiment.scenes.size() == 5);
  CHECK(experiment.scenes[0].spec.file == model);
  CHECK(experiment.scenes[1].spec.scene == folder.path() / "room.yaml");
  CHECK((experiment.scenes[2].spec.generator == "sphere" && experiment.scenes[2].spec.triangles == 500));
  CHECK(experiment.scenes[3].spec.seed == 2);
  CHECK(experiment.scenes[4].spec.generator == "sphere");
  const auto error = [&](const std::string& scenes) { return error_of([&] { (void)read(scenes); }); };
  CHECK(error("[rings.obj]").find("words.yaml:1: file '") != std::string::npos);
  CHECK(error("[sphere:many]").find("words.yaml:1: ") != std::string::npos);
  CHECK(error("[spheer:100]").find("did you mean 'sphere'") != std::string::npos);
  CHECK(error("[bunni]").find("did you mean 'bunny'") != std::string::npos);
}

TEST_CASE("ways of traversal that this machine lacks are known to configurations all the same") {
  const Registry registry = paper_registry();
  for (std::string way : {"packet16_coherent", "packet8_incoherent", "stream_coherent"})
    CHECK(check_axis_value(Axis::traversal, way, registry) == "");
  std::string wrong = "packet16_coherant";
  CHECK(check_axis_value(Axis::traversal, wrong, registry).find("did you mean 'packet16_coherent'?") !=
        std::string::npos);
}

TEST_CASE("a parameter may take the ends of its limits as they are written") {
  Parameters parameters;
  CHECK(set_parameter(parameters, "spatial_gain", "0.01").empty());
  CHECK(parameters.builder.spatial_gain == 0.01f);
  CHECK(set_parameter(parameters, "empty_bonus", "0.95").empty());
  CHECK(set_parameter(parameters, "spatial_gain", "0.0099") == "a number from 0.01 to 1");
}

TEST_CASE("what may stand below is listed without what never can, which the plan tells the reason of") {
  const std::string values = parameter_values("below");
  Parameters parameters;
  CHECK(set_parameter(parameters, "below", "bvh88") == values);
  for (const StructureEntry& entry : all_structures()) {
    const std::string name(entry.info.name);
    INFO(name);
    CHECK(((values + ",").find(" " + name + ",") != std::string::npos) == why_not_below(entry.info).empty());
    CHECK(set_parameter(parameters, "below", name).empty());
  }
}

TEST_CASE("the command line lays axes over the file") {
  const Folder folder;
  const Registry registry = paper_registry();
  const fs::path file = folder.write("small.yaml", kSmall);
  const auto count = [&](Overrides o) {
    return names(make_plan(read_experiment(file, registry, o), registry), Cell::Metric::trace).size();
  };
  CHECK(count({}) == 1);
  CHECK(count({.axes = {"isa=scalar,avx"}}) == 2);
  CHECK(count({.axes = {"workload=primary,random", "threads=1,2"}}) == 4);
  CHECK(read_experiment(file, registry, {.axes = {}, .threads = 2}).axes[index_of(Axis::threads)] ==
        std::vector<std::string>{"2"});
  CHECK(error_of([&] { count({.axes = {"iza=sse"}}); }).find("did you mean 'isa'") != std::string::npos);
  CHECK(error_of([&] { count({.axes = {"isa=sze"}}); }).find("did you mean 'sse'") != std::string::npos);
  CHECK(error_of([&] { count({.axes = {"isa="}}); }).find("empty") != std::string::npos);
  CHECK(error_of([&] { count({.axes = {"isa"}}); }).find("no axis=value") != std::string::npos);
}

TEST_CASE("the effective configuration can be run again and means the same") {
  const Folder folder;
  const Registry registry = paper_registry();
  const fs::path file = folder.write("first.yaml", R"(
experiment: first
scenes: [{generate: random_triangles, triangles: 500, seed: 3}]
axes: {structure: [tree], isa: [sse]}
include: [{structure: list, intersector: moller_trumbore}]
parameters: {bins: [8, 16]}
measure: {min_time: 0.125, memory: 512MiB}
)");
  const Experiment first = read_experiment(file, registry);
  const fs::path again = folder.write("again.yaml", effective_yaml(first));
  const Experiment second = read_experiment(again, registry);
  CHECK(effective_yaml(second) == effective_yaml(first));
  CHECK(configuration_hash(second) == configuration_hash(first));
  CHECK(second.measure.memory == std::size_t{512} << 20);
  CHECK(configuration_hash(read_experiment(file, registry, {.axes = {}, .seed = 9})) != configuration_hash(first));
}

TEST_CASE("the figure of ways to leave a surface is drawn where there are several, whatever the metrics") {
  const Folder folder;
  const auto drawn = [&](const std::string& ways, const std::string& workload) {
    const std::string yaml = "scenes: [{generate: sphere, triangles: 500}]\naxes: {structure: [tree], workload: [" +
                             workload + "]}\nmetrics: [trace]\nrays: {self_intersection: [" + ways + "]}\n";
    const std::vector<std::string> plots = read_experiment(folder.write("rays.yaml", yaml), paper_registry()).plots;
    return std::ranges::find(plots, "self_intersection") != plots.end();
  };
  CHECK(drawn("error_bound, exclusion", "diffuse"));
  CHECK_FALSE(drawn("error_bound", "diffuse"));
}
