// `morton`: its codes, its order, and how full its leaves are.
#include "core/error.h"
#include "structures/builders/morton_order.h"
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
