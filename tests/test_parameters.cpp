// What builders read of BuilderParameters is what they say that they read (structures/parameters_read.h).
#include <bit>

#include "core/error.h"
#include "structures/parameter_limits.h"
#include "structures/parameters_read.h"
#include "tests/builder_checks.h"
#include "tests/error_of.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

/// Everything that a structure shows of itself, as numbers.
class Fingerprint final : public StructureVisitor {
 public:
  void node(const NodeView& node) override {
    add(node.bounds), add(node.depth), add(std::uint32_t(node.child_bounds.size()));
    for (const Bounds3f& box : node.child_bounds) add(box);
  }
  void leaf(const LeafView& leaf) override {
    add(leaf.bounds), add(leaf.depth), add(leaf.blocks);
    numbers.insert(numbers.end(), leaf.primitives.begin(), leaf.primitives.end());
  }
  std::vector<std::uint32_t> numbers;

 private:
  void add(std::uint32_t number) { numbers.push_back(number); }
  void add(const Bounds3f& box) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      add(std::bit_cast<std::uint32_t>(box.lower[axis])), add(std::bit_cast<std::uint32_t>(box.upper[axis]));
  }
};

std::vector<std::uint32_t> shape_of(const StructureInfo& info, std::string_view builder, const TriangleMesh& mesh,
                                    const BuilderParameters& parameters) {
  BuildReport report;
  const std::string leaf(std::ranges::find(info.leaves, "triangle4") == info.leaves.end() ? info.leaves.front()
                                                                                          : "triangle4");
  const BuildSettings settings{
      .builder = std::string(builder), .leaf = leaf, .isa = best_isa(), .threads = 1, .parameters = parameters};
  Fingerprint shape;
  (void)build_structure(info.name, mesh, settings, report)->visit(shape);
  return shape.numbers;
}

/// Values other than the default; each alone changes what reads it on one of meshes() at least.
const std::vector<std::pair<std::string_view, std::vector<void (*)(BuilderParameters&)>>> kOthers{
    {"bins", {[](BuilderParameters& p) { p.bins = 4; }}},
    {"traversal_cost",
     {[](BuilderParameters& p) { p.traversal_cost = 9.0f; }, [](BuilderParameters& p) { p.traversal_cost = 0.05f; }}},
    {"intersection_cost",
     {[](BuilderParameters& p) { p.intersection_cost = 9.0f; },
      [](BuilderParameters& p) { p.intersection_cost = 0.05f; }}},
    {"max_leaf_blocks",
     {[](BuilderParameters& p) { p.max_leaf_blocks = 1; }, [](BuilderParameters& p) { p.max_leaf_blocks = 7; }}},
    {"morton_bits", {[](BuilderParameters& p) { p.morton_bits = 30; }}},
    {"ploc_radius", {[](BuilderParameters& p) { p.ploc_radius = 1; }}},
    {"duplication_budget", {[](BuilderParameters& p) { p.duplication_budget = 0.0f; }}},
    {"spatial_overlap", {[](BuilderParameters& p) { p.spatial_overlap = 1.0f; }}},
    {"spatial_gain", {[](BuilderParameters& p) { p.spatial_gain = 0.01f; }}},
    {"reinsertion_rounds", {[](BuilderParameters& p) { p.reinsertion_rounds = 1; }}},
    {"reinsertion_top",
     {[](BuilderParameters& p) { p.reinsertion_top = 0; }, [](BuilderParameters& p) { p.reinsertion_top = 4096; }}},
    {"empty_bonus", {[](BuilderParameters& p) { p.empty_bonus = 0.9f; }}},
    {"max_depth", {[](BuilderParameters& p) { p.max_depth = 2; }}},
    {"grid_density", {[](BuilderParameters& p) { p.grid_density = 4.0f; }}},
    {"below", {[](BuilderParameters& p) { p.below = "bvh2"; }}},
    {"collapse", {[](BuilderParameters& p) { p.collapse = "greedy"; }}},
};

/// Triangles in each other's way; needles among small triangles, and a knot of triangles that only the last bits of a
/// Morton code part; and a mesh large enough for a top worth reinserting: what spans the scene among what is small.
std::vector<TriangleMesh> meshes() {
  const auto add_corners = [](TriangleMesh& mesh, Vec3f a, Vec3f b, Vec3f c) {
    const auto first = std::uint32_t(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), {a, b, c});
    mesh.triangles.push_back({first, first + 1, first + 2});
  };
  std::vector<TriangleMesh> list{random_triangles(600, 0.9f, 5), random_triangles(1000, 0.02f, 3),
                                 random_triangles(12000, 0.01f, 6)};
  const TriangleMesh large = random_triangles(60, 1.5f, 8);
  for (std::size_t i = 0; i < large.size(); ++i) {
    const std::array<Vec3f, 3> corners = large.corners(i);
    add_corners(list[2], corners[0], corners[1], corners[2]);
  }
  for (std::uint32_t i = 0; i < 400; ++i) {
    const float x = 0.002f * float(i);
    add_corners(list[1], {x, 0, 0}, {x + 1, 1, 1}, {x + 1, 1.001f, 1});
    const float y = 1e-5f * float(i % 97);
    add_corners(list[1], {y, y * y, 0.5f}, {y + 1e-6f, 0, 0.5f}, {y, 1e-6f, 0.5f + y});
  }
  return list;
}

}  // namespace

TEST_CASE("a builder says what it reads: nothing else changes what it builds, and all of it can") {
  const std::vector<TriangleMesh> scenes = meshes();
  for (const StructureEntry& entry : all_structures()) {
    for (std::string_view builder : entry.info.builders) {
      const BuilderParameters defaults;
      // What stands above another takes its builders, too: here those of the one that is below by default.
      if (entry.info.takes_below) {
        const auto& below = find_structure(defaults.below)->info.builders;
        if (std::ranges::find(below, builder) == below.end()) continue;
      }
      const auto read = parameters_read(entry.info.name, builder, defaults.below);
      INFO(entry.info.name << " " << builder);
      REQUIRE(read);  // each of ours says
      // bvh8 stands for the others that let any builder make a binary tree.
      if (entry.info.name != "bvh8" && builder != entry.info.builders.front() && entry.info.builders.size() > 2)
        continue;
      const auto is_read = [&](std::size_t i) { return std::ranges::find(*read, kOthers[i].first) != read->end(); };
      std::vector<bool> changed(kOthers.size());
      for (const TriangleMesh& mesh : scenes) {
        const bool is_large = &mesh == &scenes.back();  // for what the small ones do not show
        std::vector<std::uint32_t> usual;
        for (std::size_t i = 0; i < kOthers.size(); ++i) {
          if (changed[i] || (is_large && !is_read(i))) continue;
          if (usual.empty()) usual = shape_of(entry.info, builder, mesh, defaults);
          for (const auto set : kOthers[i].second) {
            BuilderParameters other;
            set(other);
            changed[i] = changed[i] || shape_of(entry.info, builder, mesh, other) != usual;
          }
        }
      }
      for (std::size_t i = 0; i < kOthers.size(); ++i) {
        INFO(kOthers[i].first);
        CHECK(changed[i] == is_read(i));
      }
    }
  }
}

TEST_CASE("what is above another structure reads what that one reads; none is read by what is not there") {
  const auto reads = [](std::string_view name, std::string_view builder, std::string_view below) {
    return std::ranges::count(*parameters_read("two_level", builder, below), name) == 1;
  };
  CHECK(reads("below", "binned_sah", "bvh8"));
  CHECK(reads("max_leaf_blocks", "binned_sah", "bvh8"));
  CHECK(reads("grid_density", "uniform", "grid"));
  CHECK_FALSE(reads("grid_density", "binned_sah", "bvh8"));
  CHECK_FALSE(reads("max_leaf_blocks", "uniform", "grid"));
  CHECK(parameters_read("no such structure", "binned_sah")->empty());
  CHECK(parameters_read("brute_force", "in_order")->empty());
}

TEST_CASE("what is out of range is refused, with the limits") {
  const auto refusal = [](auto&& set) {
    BuilderParameters p;
    set(p);
    return error_of([&] { check_parameters(p); });
  };
  for (const unsigned bins : {4u, 64u}) CHECK(refusal([&](auto& p) { p.bins = bins; }).empty());
  CHECK(refusal([](auto& p) { p.bins = 3; }) == "bins: 3 is not within 4 .. 64");
  CHECK(refusal([](auto& p) { p.bins = 65; }) == "bins: 65 is not within 4 .. 64");
  CHECK(refusal([](auto& p) { p.bins = p.kOwn; }) == "bins: 4294967295 is not within 4 .. 64");
  CHECK(refusal([](auto& p) { p.empty_bonus = 0.96f; }) == "empty_bonus: 0.96 is not within 0 .. 0.95");
  CHECK(refusal([](auto& p) { p.spatial_gain = 0.01f; }).empty());
  CHECK(refusal([](auto& p) { p.spatial_gain = std::numeric_limits<float>::quiet_NaN(); }) ==
        "spatial_gain: nan is not within 0.01 .. 1");
  CHECK(refusal([](auto& p) { p.morton_bits = 31; }) == "morton_bits: 31 is neither 30 nor 63");
  CHECK(refusal([](auto& p) { p.collapse = "best"; }) == "collapse: 'best' is neither optimal nor greedy");
  CHECK(refusal([](auto& p) { p.reinsertion_top = p.kOwn; }).empty());
  CHECK(error_of([] {
          require_within("octree: max_depth", 22u, {0, 21});
        }) == "octree: max_depth: 22 is not within 0 .. 21");
  // Every name once, and the defaults are within.
  check_parameters({}), check_settings({});
  std::set<std::string_view> names;
  for (const auto& p : builder_parameter_table()) names.insert(p.name);
  for (const auto& p : traversal_setting_table()) names.insert(p.name);
  CHECK(names.size() == builder_parameter_table().size() + traversal_setting_table().size());
  require_triangles("bih", kMaxReferences);
  CHECK_THROWS_WITH(require_triangles("bih", kMaxReferences + 1), "bih takes at most 2^30 - 1 triangles");
  CHECK_THROWS_WITH(require_triangles("kdtree", 1u << 28, (1u << 28) - 1), "kdtree takes at most 2^28 - 1 triangles");
}

TEST_CASE("every structure refuses a leaf that it does not have, before it builds") {
  for (const TriangleMesh& mesh : {TriangleMesh{}, random_triangles(20, 0.5f, 1)}) {
    for (const StructureEntry& entry : all_structures()) {
      BuildSettings settings;
      settings.builder = entry.info.builders.front(), settings.leaf = "triangle5";
      BuildReport report;
      INFO(entry.info.name);
      CHECK_THROWS_WITH(entry.create()->build(mesh, settings, report),
                        Catch::Contains("leaf") && Catch::Contains("triangle5"));
      CHECK(report.phases.empty());
    }
  }
}

TEST_CASE("every builder is held to the limits of all parameters, whether it reads them or not") {
  const TriangleMesh mesh = random_triangles(10, 0.1f, 1);
  BuilderParameters parameters;
  parameters.duplication_budget = 4.1f;
  for (const std::string_view builder : binary_builder_names()) {
    INFO(builder);
    CHECK(error_of([&] { (void)build(builder, mesh, 4, 1, best_isa(), parameters); }) ==
          "duplication_budget: 4.1 is not within 0 .. 4");
  }
  CHECK(splits_triangles("spatial_sah_reinsertion"));
  CHECK_FALSE(splits_triangles("morton"));
}
