// Every builder of binary trees (binary_builder_names()): what a tree must be, on ordinary and on degenerate meshes, for any
// number of threads. A new builder is tested because it is in the table.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include "core/error.h"
#include "core/random.h"
#include "structures/builders/builders.h"
#include "structures/builders/clip.h"
#include "structures/builders/collapse.h"
#include "structures/builders/linked_tree.h"
#include "structures/builders/morton_order.h"
#include "structures/statistics.h"
#include "tests/catch.h"
#include "tests/kernel_scenes.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

constexpr std::string_view kReinsertion = "_reinsertion";

/// Builders that may refer to a triangle more than once, from boxes that hold parts of it.
bool splits_triangles(std::string_view builder) { return builder.starts_with("spatial") || builder.starts_with("embree_high"); }

BinaryTree build(std::string_view builder, const TriangleMesh& mesh, unsigned leaf_width, unsigned threads = 1, Isa isa = best_isa(),
                 const BuilderParameters& parameters = {}) {
  BuildSettings settings;
  settings.builder = builder, settings.isa = isa, settings.threads = threads, settings.parameters = parameters;
  BinaryTree tree;
  BuildReport report;
  tbb::task_arena(int(threads), 1).execute([&] { build_binary_tree(mesh, settings, leaf_width, tree, report); });
  if (mesh.size() > 0) CHECK(!report.phases.empty());
  return tree;
}

Bounds3f box_of(const BinaryNode& node) { return {node.lower, node.upper}; }

/// Whether every part of the triangle that we look at is in one of the boxes.
bool covers(const std::vector<Bounds3f>& boxes, const std::array<Vec3f, 3>& corner) {
  constexpr int kSteps = 8;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; i + j <= kSteps; ++j) {
      const float u = float(i) / kSteps, v = float(j) / kSteps;
      const Vec3f p = corner[0] * (1 - u - v) + corner[1] * u + corner[2] * v;  // rounded: allow for that
      const float slack = 1e-5f * std::max({std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)});
      const Vec3f s{slack, slack, slack};
      const bool inside = std::ranges::any_of(boxes, [&](const Bounds3f& b) { return Bounds3f{b.lower - s, b.upper + s}.contains({p, p}); });
      if (!inside) return false;
    }
  }
  return true;
}

struct Facts {
  unsigned depth = 0;
  std::size_t leaves = 0;
  std::uint64_t hash = 1;
};

/// Walks the tree without recursion, checks what BinaryTree promises, and hashes it without node numbers.
Facts check_tree(const BinaryTree& tree, const TriangleMesh& mesh, unsigned leaf_width, bool splits) {
  Facts facts;
  if (mesh.size() == 0) {
    CHECK(tree.primitives.empty());
    return facts;
  }
  const auto put = [&](std::uint64_t x) { facts.hash = mix64(facts.hash ^ x); };
  REQUIRE(tree.node_count >= 1);
  REQUIRE(tree.node_count <= tree.nodes.size());
  REQUIRE(tree.nodes[0].count == tree.primitives.size());
  std::vector<unsigned> seen(mesh.size());
  std::vector<std::vector<Bounds3f>> parts(splits ? mesh.size() : 0);
  std::size_t wrong_links = 0, wrong_boxes = 0, wrong_leaves = 0, next = 0;
  std::vector<std::pair<std::uint32_t, unsigned>> stack{{0, 0}};
  while (!stack.empty()) {
    const auto [index, depth] = stack.back();
    stack.pop_back();
    const BinaryNode& node = tree.nodes[index];
    put(depth), put(node.count);
    for (int axis = 0; axis < 3; ++axis) put(std::bit_cast<std::uint32_t>(node.lower[axis])), put(std::bit_cast<std::uint32_t>(node.upper[axis]));
    if (!node.is_leaf()) {
      if (node.left + 1 >= tree.node_count) FAIL("a child beyond the last node");
      const BinaryNode &left = tree.nodes[node.left], &right = tree.nodes[node.left + 1];
      wrong_links += left.count + right.count != node.count || left.count == 0 || right.count == 0;
      wrong_boxes += !box_of(node).contains(box_of(left)) || !box_of(node).contains(box_of(right));
      stack.emplace_back(node.left + 1, depth + 1), stack.emplace_back(node.left, depth + 1);
      continue;
    }
    ++facts.leaves;
    facts.depth = std::max(facts.depth, depth);
    wrong_leaves += node.count < 1 || node.count > leaf_width || tree.first[index] != next;
    for (std::size_t i = next; i < next + node.count; ++i) {
      const std::uint32_t p = tree.primitives[i];
      if (p >= mesh.size()) FAIL("no such triangle: " << p);
      put(p), ++seen[p];
      if (splits) {
        parts[p].push_back(box_of(node));
      } else {
        wrong_boxes += !box_of(node).contains(mesh.bounds(p));
      }
    }
    next += node.count;
  }
  CHECK(next == tree.primitives.size());
  CHECK(wrong_links == 0);
  CHECK(wrong_boxes == 0);
  CHECK(wrong_leaves == 0);
  CHECK(std::ranges::none_of(seen, [](unsigned n) { return n == 0; }));
  if (splits) {
    std::size_t uncovered = 0;
    for (std::size_t i = 0; i < mesh.size(); ++i) uncovered += !covers(parts[i], mesh.corners(i));
    CHECK(uncovered == 0);
  } else {
    CHECK(tree.primitives.size() == mesh.size());
  }
  return facts;
}

/// The triangle (0,0,0) (1,0,0) (0,1,0), scaled by sizes[i] about its box's centre and moved to centres[i].
TriangleMesh copies(const std::vector<Vec3f>& centres, const std::vector<float>& sizes) {
  TriangleMesh mesh;
  for (std::size_t i = 0; i < centres.size(); ++i) {
    const auto first = std::uint32_t(mesh.vertices.size());
    const float h = 0.5f * sizes[i];
    for (const Vec3f corner : {Vec3f{-h, -h, 0}, Vec3f{h, -h, 0}, Vec3f{-h, h, 0}}) mesh.vertices.push_back(centres[i] + corner);
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

std::vector<Vec3f> random_points(std::size_t n, float extent, std::uint64_t seed) {
  std::vector<Vec3f> points(n);
  for (std::size_t i = 0; i < n; ++i) points[i] = uniform_point(seed, i, 0, {{0, 0, 0}, {extent, extent, extent}});
  return points;
}

std::vector<KernelScene> degenerate_scenes() {
  std::vector<KernelScene> scenes;
  scenes.push_back({"one triangle", random_triangles(1, 0.5f, 1)});
  scenes.push_back({"flat", flat_grid(64)});
  std::vector<float> sizes(8000);
  for (std::size_t i = 0; i < sizes.size(); ++i) sizes[i] = 1.0f + float(i % 1000);
  scenes.push_back({"concentric: equal centroids", copies(std::vector<Vec3f>(8000), sizes)});
  std::vector<Vec3f> cluster = random_points(8000, 1e-7f, 2);  // B16: one Morton cell of a unit scene
  cluster.push_back({1, 1, 1});
  scenes.push_back({"a cluster in one Morton cell", copies(cluster, std::vector<float>(cluster.size(), 1e-8f))});
  std::vector<Vec3f> outlier = random_points(8000, 1.0f, 3);
  outlier.push_back({1e12f, 0, 0});
  scenes.push_back({"an outlier at 1e12", copies(outlier, std::vector<float>(outlier.size(), 0.01f))});
  std::vector<Vec3f> powers;
  sizes.clear();
  for (int i = -60; i <= 39; ++i) powers.push_back({std::ldexp(1.0f, i), 0, 0}), sizes.push_back(std::ldexp(0.25f, i));
  scenes.push_back({"powers of two", copies(powers, sizes)});
  std::vector<Vec3f> squares;  // each nearer to the one before than to the next: merges one pair at a time
  for (int i = 0; i < 3000; ++i) squares.push_back({float(i) * float(i), 0, 0});
  scenes.push_back({"growing gaps", copies(squares, std::vector<float>(squares.size(), 0.5f))});
  TriangleMesh slivers;
  for (std::uint32_t i = 0; i < 2000; ++i) {
    const float o = float(i) * 0x1p-20f;
    slivers.vertices.insert(slivers.vertices.end(), {{o, 0, 0}, {1 + o, 1, 1}, {o, 0x1p-10f, 0}});
    slivers.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  scenes.push_back({"diagonal slivers", slivers});
  scenes.push_back({"points", copies(random_points(5000, 1.0f, 4), std::vector<float>(5000, 0.0f))});
  return scenes;
}

double sah_of(std::string_view builder, const TriangleMesh& mesh, const BuilderParameters& parameters = {}) {
  BuildSettings settings;
  settings.builder = builder, settings.leaf = "triangle4", settings.isa = best_isa(), settings.parameters = parameters;
  BuildReport report;
  const auto accel = build_structure("bvh2", mesh, settings, report);
  return compute_statistics(*accel, mesh, {}, false).sah_cost;
}

}  // namespace

TEST_CASE("every builder: references, boxes, the same tree for any number of threads") {
  std::vector<KernelScene> scenes = kernel_scenes();
  scenes.push_back({"random 100000", random_triangles(100000, 0.01f, 9)});
  scenes.push_back({"large sphere", sphere(150)});
  scenes.push_back({"empty", {}});
  const tbb::global_control more_threads_than_cores(tbb::global_control::max_allowed_parallelism, 7);
  for (const std::string_view builder : binary_builder_names()) {
    for (const KernelScene& scene : scenes) {
      for (const unsigned leaf_width : {1u, 4u, 8u}) {
        if (scene.mesh.size() > 10000 && leaf_width == 1) continue;
        INFO(builder << ", " << scene.name << ", leaves of " << leaf_width);
        const bool splits = splits_triangles(builder);
        const Facts one = check_tree(build(builder, scene.mesh, leaf_width), scene.mesh, leaf_width, splits);
        for (const unsigned threads : {2u, 7u}) {
          INFO(threads << " threads");
          CHECK(check_tree(build(builder, scene.mesh, leaf_width, threads), scene.mesh, leaf_width, splits).hash == one.hash);
        }
        if (scene.mesh.size() < 10000) CHECK(check_tree(build(builder, scene.mesh, leaf_width, 1, Isa::scalar), scene.mesh, leaf_width, splits).hash == one.hash);
      }
    }
  }
}

TEST_CASE("every builder: degenerate meshes") {
  for (const KernelScene& scene : degenerate_scenes()) {
    for (const std::string_view builder : binary_builder_names()) {
      INFO(builder << ", " << scene.name);
      const Facts facts = check_tree(build(builder, scene.mesh, 4), scene.mesh, 4, splits_triangles(builder));
      CHECK(check_tree(build(builder, scene.mesh, 4, 2), scene.mesh, 4, splits_triangles(builder)).hash == facts.hash);
    }
  }
}

TEST_CASE("every builder: a million equal triangles end in a shallow tree") {
  const TriangleMesh mesh = repeated(random_triangles(1, 0.5f, 1), 1000000);
  for (const std::string_view builder : binary_builder_names()) {
    INFO(builder);
    const Facts facts = check_tree(build(builder, mesh, 4), mesh, 4, splits_triangles(builder));
    CHECK(facts.depth < 64);
  }
}

TEST_CASE("morton codes have 30 or 63 bits") {
  const TriangleMesh mesh = random_triangles(3000, 0.1f, 2);
  for (const std::string_view builder : {"morton", "ploc"}) {
    if (std::ranges::find(binary_builder_names(), builder) == binary_builder_names().end()) continue;
    INFO(builder);
    BuilderParameters parameters;
    for (const unsigned bits : {30u, 63u}) {
      parameters.morton_bits = bits;
      check_tree(build(builder, mesh, 4, 1, best_isa(), parameters), mesh, 4, false);
    }
    for (const unsigned bits : {0u, 31u, 62u, 64u}) {
      parameters.morton_bits = bits;
      CHECK_THROWS_AS(build(builder, mesh, 4, 1, best_isa(), parameters), UserError);
    }
  }
}

TEST_CASE("more bits tell more triangles apart") {
  // Two far clusters: with 10 bits an axis each falls into one cell and keeps the mesh's random order.
  std::vector<Vec3f> centres = random_points(4000, 1e-4f, 5);
  for (std::size_t i = 0; i < 4000; ++i) centres.push_back(centres[i] + Vec3f{1, 1, 1});
  const TriangleMesh mesh = copies(centres, std::vector<float>(centres.size(), 1e-6f));
  const auto area = [&](unsigned bits) {
    BuilderParameters parameters;
    parameters.morton_bits = bits;
    const BinaryTree tree = build("morton", mesh, 4, 1, best_isa(), parameters);
    double sum = 0.0;
    std::vector<std::uint32_t> stack{0};
    while (!stack.empty()) {
      const BinaryNode& node = tree.nodes[stack.back()];
      stack.pop_back();
      sum += node.half_area();
      if (!node.is_leaf()) stack.push_back(node.left), stack.push_back(node.left + 1);
    }
    return sum - tree.nodes[0].half_area();
  };
  CHECK(area(63) < 0.2 * area(30));
}

TEST_CASE("the Morton order told apart as far as there are bits is that of the whole codes, equals by id") {
  // Crowds that share the first 30 bits, of sizes that are sorted in different ways; then some of one place.
  std::vector<Vec3f> centres{{0, 0, 0}, {1, 1, 1}};
  for (const std::size_t crowd : {3, 24, 25, 100, 700, 2048, 2049, 20000}) {
    const Vec3f at = random_points(1, 0.4f, 100 + crowd)[0] + Vec3f{0.5f, 0.5f, 0.5f};
    for (const Vec3f& p : random_points(crowd, 1e-4f, crowd)) centres.push_back(at + p);
    for (int i = 0; i < 5; ++i) centres.push_back(at);
  }
  const TriangleMesh mesh = copies(centres, std::vector<float>(centres.size(), 1e-7f));
  Box4 bounds;
  for (const Vec3f& v : mesh.vertices) bounds.extend(_mm_setr_ps(2 * v.x, 2 * v.y, 2 * v.z, 0));
  const TriangleBoxes boxes(mesh);
  for (const unsigned bits : {30u, 63u}) {
    const MortonCells cells(bounds, bits);
    const auto code = [&](std::uint32_t id) {
      const Box4 box = boxes.box(id);
      return cells.code(_mm_add_ps(box.lower, box.upper));
    };
    for (const unsigned sorted : {21u, 30u}) {
      MortonOrder order(mesh, bits, sorted);
      order.refine_runs(1);
      std::size_t wrong = 0, equal = 0;
      for (std::size_t i = 1; i < order.size(); ++i) {
        const std::uint64_t before = code(order.id(i - 1)), here = code(order.id(i));
        equal += before == here, wrong += before > here || (before == here && order.id(i - 1) >= order.id(i));
      }
      INFO(bits << " bits, " << sorted << " of them at first");
      CHECK(wrong == 0);
      CHECK(equal > (bits == 30 ? 20000 : 30));
      CHECK(equal < (bits == 30 ? order.size() : 1000));
    }
  }
}

TEST_CASE("morton: what three leaf blocks hold fills no more than it needs") {
  std::vector<Vec3f> centres = random_points(20000, 1.0f, 6);
  for (int i = 0; i < 5000; ++i) centres.push_back(centres[std::size_t(i % 50)]);  // a hundred and more of one code
  const TriangleMesh mesh = copies(centres, std::vector<float>(centres.size(), 1e-3f));
  for (const unsigned width : {1u, 4u, 8u, 16u}) {
    INFO("blocks of " << width);
    const BinaryTree tree = build("morton", mesh, width);
    std::size_t seen = 0, wrong = 0;
    const auto leaves = [&](const auto& self, std::uint32_t index) -> std::size_t {
      const BinaryNode& node = tree.nodes[index];
      const std::size_t count = node.is_leaf() ? 1 : self(self, node.left) + self(self, node.left + 1);
      if (node.count <= 3 * width) ++seen, wrong += count != (node.count + width - 1) / width;
      return count;
    };
    leaves(leaves, 0);
    CHECK(seen > 25000 / (4 * width));
    CHECK(wrong == 0);
  }
}

TEST_CASE("morton: vertices that no triangle has do not spoil the tree") {
  TriangleMesh mesh = sphere(100);
  BuilderParameters parameters;
  parameters.morton_bits = 30;  // with 63 more bits would be looked at where the first tell nothing apart
  const double cost = sah_of("morton", mesh, parameters);
  for (const Vec3f stray : {Vec3f{1e6f, 0, 0}, Vec3f{std::numeric_limits<float>::quiet_NaN(), 0, 0}, Vec3f{0, std::numeric_limits<float>::infinity(), 0}}) {
    INFO("stray vertex " << stray.x << " " << stray.y);
    mesh.vertices.push_back(stray);
    check_tree(build("morton", mesh, 4, 1, best_isa(), parameters), mesh, 4, false);
    CHECK(std::fabs(sah_of("morton", mesh, parameters) / cost - 1.0) < 0.03);
    mesh.vertices.pop_back();
  }
}

TEST_CASE("reinsertion lowers the SAH cost of every builder's tree") {
  std::vector<KernelScene> scenes;
  scenes.push_back({"random 20000", random_triangles(20000, 0.1f, 6)});
  scenes.push_back({"sphere", sphere(80)});
  for (const std::string_view builder : binary_builder_names()) {
    if (!builder.ends_with(kReinsertion)) continue;
    const std::string_view plain = builder.substr(0, builder.size() - kReinsertion.size());
    REQUIRE(std::ranges::find(binary_builder_names(), plain) != binary_builder_names().end());
    for (const KernelScene& scene : scenes) {
      INFO(builder << ", " << scene.name);
      CHECK(sah_of(builder, scene.mesh) < sah_of(plain, scene.mesh));
    }
  }
}

namespace {

void append(TriangleMesh& mesh, const TriangleMesh& more) {
  const auto first = std::uint32_t(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), more.vertices.begin(), more.vertices.end());
  for (const Triangle& t : more.triangles) mesh.triangles.push_back({first + t.a, first + t.b, first + t.c});
}

}  // namespace

TEST_CASE("reinsertion of the top lowers the SAH cost where triangles differ in size") {
  // Many small triangles among a few that span the scene: what a plane cannot part.
  TriangleMesh crowded = random_triangles(20000, 0.01f, 6);
  const TriangleMesh walls = random_triangles(300, 1.0f, 7);
  append(crowded, walls);
  const TriangleMesh even = sphere(80);
  for (const std::string_view builder : binary_builder_names()) {
    if (builder.ends_with(kReinsertion)) continue;
    INFO(builder);
    BuilderParameters with, without;
    with.reinsertion_top = 512, without.reinsertion_top = 0;
    for (unsigned threads : {1u, 3u}) check_tree(build(builder, crowded, 8, threads, best_isa(), with), crowded, 8, splits_triangles(builder));
    // Left to itself a builder from the top down does it.
    const bool does = builder == "binned_sah" || builder == "sweep_sah" || builder == "spatial_sah";
    CHECK(sah_of(builder, crowded, with) < (does ? 0.99 : 1.0) * sah_of(builder, crowded, without));
    CHECK(sah_of(builder, even, with) < 1.001 * sah_of(builder, even, without));
    CHECK(sah_of(builder, crowded) == sah_of(builder, crowded, does ? with : without));
  }
  BuilderParameters parameters;
  parameters.reinsertion_top = 65537;
  CHECK_THROWS_AS(build("binned_sah", even, 4, 1, best_isa(), parameters), UserError);
}

TEST_CASE("of a wide node's children the ones that cost least stand last") {
  // Walls among small things: leaves and subtrees of all sizes side by side.
  TriangleMesh mesh = random_triangles(20000, 0.01f, 8);
  const TriangleMesh walls = random_triangles(200, 1.0f, 9);
  append(mesh, walls);
  CollapseSettings settings;
  settings.block_width = 8, settings.node_bytes = 224, settings.block_bytes = 352;
  const WideTree wide = collapse(build("binned_sah", mesh, 8), settings);
  std::size_t out_of_order = 0, apart = 0;
  const auto cost = [&](const auto& self, const WideNode& node) -> double {
    if (node.is_leaf()) return 0.25 + double(node.blocks);
    double sum = 1.0, before = std::numeric_limits<double>::infinity();
    for (const WideNode& child : wide.children(node)) {
      const double its = self(self, child), steps = std::log2(its) / 3.0;
      // Within rounding either of two neighbouring steps may be meant.
      out_of_order += std::round(steps - 1e-4) > std::round(before + 1e-4);
      apart += std::round(steps) < std::round(before);
      before = steps;
      const auto area = [](const Bounds3f& box) { return double(half_area(box.lower, box.upper)); };
      sum += its * area(child.box) / area(node.box);
    }
    return sum;
  };
  CHECK(cost(cost, wide.nodes[0]) > 1.0);
  CHECK(out_of_order == 0);
  CHECK(apart > 100);
}

namespace {

/// Long thin triangles in any direction.
TriangleMesh needles(std::size_t count) {
  TriangleMesh mesh;
  const Bounds3f cube{{-1, -1, -1}, {1, 1, 1}};
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f middle = uniform_point(21, i, 0, cube), along = 0.3f * uniform_point(21, i, 3, cube);
    const auto first = std::uint32_t(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), {middle - along, middle + along, middle + along + 1e-3f * uniform_point(21, i, 6, cube)});
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

}  // namespace

TEST_CASE("spatial splits keep their budget") {
  const TriangleMesh mesh = needles(20000);
  for (const float budget : {0.0f, 0.1f, 0.5f, 2.0f}) {
    BuilderParameters parameters;
    parameters.duplication_budget = budget;
    const BinaryTree tree = build("spatial_sah", mesh, 4, 2, best_isa(), parameters);
    check_tree(tree, mesh, 4, true);
    INFO(budget);
    CHECK(tree.primitives.size() <= std::size_t(double(mesh.size()) * (1.0 + double(budget))));
    if (budget >= 0.5f) CHECK(tree.primitives.size() > mesh.size());
  }
  BuilderParameters parameters;
  parameters.duplication_budget = 5.0f;
  CHECK_THROWS_AS(build("spatial_sah", mesh, 4, 1, best_isa(), parameters), UserError);
}

TEST_CASE("binned_sah holds little beside what it builds") {
  for (const KernelScene& scene : {KernelScene{"needles", needles(100000)}, KernelScene{"sphere", sphere(150)}}) {
    INFO(scene.name);
    BuildSettings settings;
    settings.leaf = "triangle8", settings.isa = best_isa();
    BuildReport report;
    const auto accel = build_structure("bvh8", scene.mesh, settings, report);
    CHECK(double(report.peak_bytes) < 1.6 * double(accel->bytes()));
  }
}

TEST_CASE("spatial splits lower the cost of needles; a full sweep costs no more than bins") {
  const TriangleMesh mesh = needles(20000);
  CHECK(sah_of("spatial_sah", mesh) < 0.9 * sah_of("binned_sah", mesh));
  CHECK(sah_of("sweep_sah", mesh) < 1.02 * sah_of("binned_sah", mesh));
  CHECK(sah_of("sweep_sah", sphere(80)) < 1.02 * sah_of("binned_sah", sphere(80)));
}

TEST_CASE("a leaf does not hold a triangle twice") {
  const TriangleMesh mesh = needles(20000);
  struct Visitor final : StructureVisitor {
    void node(const NodeView&) override {}
    void leaf(const LeafView& leaf) override {
      std::vector<std::uint32_t> ids(leaf.primitives.begin(), leaf.primitives.end());
      std::ranges::sort(ids);
      twice += std::ranges::adjacent_find(ids) != ids.end();
      most = std::max(most, leaf.blocks);
    }
    std::size_t twice = 0;
    unsigned most = 0;
  };
  for (const char* structure : {"bvh2", "bvh8"}) {
    for (const char* builder : {"spatial_sah", "spatial_sah_reinsertion"}) {
      BuildSettings settings;
      settings.builder = builder, settings.leaf = "triangle4", settings.isa = best_isa();
      settings.parameters.intersection_cost = 0.3f;  // so that leaves are merged
      BuildReport report;
      Visitor visitor;
      REQUIRE(build_structure(structure, mesh, settings, report)->visit(visitor));
      INFO(structure << " " << builder);
      CHECK(visitor.twice == 0);
      CHECK(visitor.most > 1);
    }
  }
}

TEST_CASE("a triangle cut by a plane has the boxes of its two slabs") {
  std::size_t cut = 0;
  for (std::uint64_t i = 0; i < 3000; ++i) {
    std::array<Vec3f, 3> c;
    for (unsigned k = 0; k < 3; ++k)
      for (unsigned a = 0; a < 3; ++a) c[k][a] = i % 3 == 0 ? float(int(8 * random_float(91, 9 * i + 3 * k + a, 0))) : random_float(91, 9 * i + 3 * k + a, 0) - 0.5f;
    Bounds3f box;
    for (Vec3f p : c) box.extend(p);
    const int axis = int(i % 3);
    for (float plane : {c[0][std::size_t(axis)], 0.3f * c[1][std::size_t(axis)] + 0.7f * c[2][std::size_t(axis)], box.upper[std::size_t(axis)] + 1.0f}) {
      INFO("triangle " << i << ", plane " << plane);
      Bounds3f low, high;
      clip_by_plane(c, axis, plane, low, high);
      const Bounds3f want_low = clip_to_slab(c, axis, box.lower[std::size_t(axis)], plane), want_high = clip_to_slab(c, axis, plane, box.upper[std::size_t(axis)]);
      CHECK(low.empty() == want_low.empty());
      CHECK(high.empty() == want_high.empty());
      if (!want_low.empty()) CHECK(low == want_low);
      if (!want_high.empty()) CHECK(high == want_high);
      cut += !low.empty() && !high.empty();
    }
  }
  CHECK(cut > 3000);
}
