// `morton`: its codes, its order, how full its leaves are, and leaf blocks that are filled while it makes the tree.
#include <cstring>

#include <tbb/global_control.h>

#include "core/error.h"
#include "structures/builders/morton_order.h"
#include "structures/leaves/leaf_blocks.h"
#include "tests/builder_checks.h"

using namespace arboretum;
using namespace arboretum::test;

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

namespace {

struct TreeInBlocks {
  BinaryTree tree;
  Arena blocks;
};

TreeInBlocks build_in_blocks(const TriangleMesh& mesh, const LeafForm& form, unsigned threads) {
  LeafBlocks blocks(form, 0);
  BuildSettings settings;
  settings.builder = "morton", settings.isa = best_isa(), settings.threads = threads;
  TreeInBlocks built;
  BuildReport report;
  tbb::task_arena(int(threads), 1).execute([&] {
    build_binary_tree(mesh, settings, form.width, built.tree, report, {2, {}, &blocks});
  });
  REQUIRE(built.tree.in_blocks);
  built.blocks = blocks.take(0);
  return built;
}

/// Compares the trees below two nodes; `block` is the first below, then the one behind.
void check_same(const BinaryTree& a, std::uint32_t i, const TreeInBlocks& b, std::uint32_t j, const LeafForm& form,
                std::size_t& block, std::size_t& wrong) {
  const BinaryNode &x = a.nodes[i], &y = b.tree.nodes[j];
  wrong += x.lower != y.lower || x.upper != y.upper || x.is_leaf() != y.is_leaf();
  if (wrong > 0) return;
  const std::size_t first = block;
  if (x.is_leaf()) {
    std::vector<std::uint32_t> ids;
    form.append(b.blocks.data() + block++ * form.bytes, 1, ids);
    wrong += !std::equal(ids.begin(), ids.end(), &a.primitives[a.first[i]], &a.primitives[a.first[i]] + x.count);
  } else {
    check_same(a, x.left, b, y.left, form, block, wrong), check_same(a, x.left + 1, b, y.left + 1, form, block, wrong);
  }
  wrong += y.count != (block - first) * form.width;
}

}  // namespace

TEST_CASE("morton: leaf blocks filled while the tree is made are the tree's, in its order, for any number of threads") {
  const tbb::global_control more_threads_than_cores(tbb::global_control::max_allowed_parallelism, 7);
  std::vector<Vec3f> peeled;  // one by one
  for (int i = 0; i < 20; ++i)
    for (const Vec3f& axis : {Vec3f{1, 0, 0}, Vec3f{0, 1, 0}, Vec3f{0, 0, 1}})
      peeled.push_back(axis * std::ldexp(1, i));
  for (int i = 0; i < 20; ++i) peeled.push_back({0, 0, 0});
  std::vector<Vec3f> crowded = random_points(150000, 1.0f, 7);  // more than the caches are taken to hold
  for (const Vec3f& p : random_points(20000, 1e-4f, 8)) crowded.push_back(p);
  for (const TriangleMesh& mesh :
       {random_triangles(1, 0.5f, 1), copies(peeled, std::vector<float>(peeled.size(), 1e-3f)), sphere(80),
        copies(crowded, std::vector<float>(crowded.size(), 1e-3f))}) {
    for (const char* leaf : {"triangle1", "triangle4v", "triangle8", "triangle16h"}) {
      INFO(mesh.size() << " triangles, " << leaf);
      const LeafForm& form = *find_leaf_form(leaf);
      const BinaryTree tree = build("morton", mesh, form.width);
      const TreeInBlocks one = build_in_blocks(mesh, form, 1);
      std::size_t block = 0, wrong = 0;
      check_same(tree, 0, one, 0, form, block, wrong);
      CHECK(wrong == 0);
      CHECK(one.blocks.bytes() == block * form.bytes);
      for (const unsigned threads : {2u, 7u}) {
        const TreeInBlocks other = build_in_blocks(mesh, form, threads);
        REQUIRE(other.blocks.bytes() == one.blocks.bytes());
        CHECK(std::memcmp(other.blocks.data(), one.blocks.data(), one.blocks.bytes()) == 0);
      }
    }
  }
}

TEST_CASE("morton: vertices that no triangle has do not spoil the tree") {
  TriangleMesh mesh = sphere(100);
  BuilderParameters parameters;
  parameters.morton_bits = 30;  // with 63 more bits would be looked at where the first tell nothing apart
  const double cost = sah_of("morton", mesh, parameters);
  for (const Vec3f stray : {Vec3f{1e6f, 0, 0}, Vec3f{std::numeric_limits<float>::quiet_NaN(), 0, 0},
                            Vec3f{0, std::numeric_limits<float>::infinity(), 0}}) {
    INFO("stray vertex " << stray.x << " " << stray.y);
    mesh.vertices.push_back(stray);
    check_tree(build("morton", mesh, 4, 1, best_isa(), parameters), mesh, 4, false);
    CHECK(std::fabs(sah_of("morton", mesh, parameters) / cost - 1.0) < 0.03);
    mesh.vertices.pop_back();
  }
}
