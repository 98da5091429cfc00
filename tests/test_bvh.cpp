// The wide BVHs: that a tree holds every triangle once and inside its boxes, that it is the same for any number of
// threads and any ISA, and the structure-level cases that break builders and stacks.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <vector>

#include "core/error.h"
#include "intersectors/blocks.h"
#include "oracle/oracle.h"
#include "structures/accel.h"
#include "structures/builders/box4.h"
#include "structures/leaves/leaf_form.h"
#include "tests/catch.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"
#include "traversal/kernel_table.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

/// Everything that a visitor sees, as numbers, in order.
class Recorder final : public StructureVisitor {
 public:
  explicit Recorder(const TriangleMesh& mesh) : mesh_(mesh), seen_(mesh.size(), 0) {}
  void node(const NodeView& n) override {
    put(n.depth), put(n.bounds), put(n.child_bounds.size());
    for (const Bounds3f& b : n.child_bounds) put(b), inside_ &= n.bounds.contains(b);
    ++nodes;
  }
  void leaf(const LeafView& l) override {
    put(l.depth), put(l.bounds), put(l.blocks);
    depth = std::max(depth, l.depth);
    largest_leaf = std::max<std::size_t>(largest_leaf, l.primitives.size());
    for (std::uint32_t p : l.primitives) put(p), ++seen_.at(p), inside_ &= l.bounds.contains(mesh_.bounds(p));
    filled_ &= l.primitives.size() <= std::size_t{l.blocks} * l.block_width;
    ++leaves;
  }
  [[nodiscard]] bool every_triangle_once() const {
    return std::ranges::all_of(seen_, [](unsigned n) { return n == 1; });
  }
  [[nodiscard]] bool boxes_hold() const { return inside_ && filled_; }
  [[nodiscard]] std::uint64_t hash() const { return hash_; }
  std::size_t nodes = 0, leaves = 0, largest_leaf = 0;
  unsigned depth = 0;

 private:
  void put(std::uint64_t x) { hash_ = mix64(hash_ ^ x); }
  void put(const Bounds3f& b) {
    for (int axis = 0; axis < 3; ++axis)
      put(std::bit_cast<std::uint32_t>(b.lower[axis])), put(std::bit_cast<std::uint32_t>(b.upper[axis]));
  }
  const TriangleMesh& mesh_;
  std::vector<unsigned> seen_;
  std::uint64_t hash_ = 1;
  bool inside_ = true, filled_ = true;
};

const char* const kBvhs[] = {"bvh2", "bvh4", "bvh8", "bvh16"};

std::unique_ptr<Accel> build(const char* structure, const TriangleMesh& mesh, const char* leaf, unsigned threads = 1,
                             Isa isa = Isa::scalar, const BuilderParameters& parameters = {},
                             const char* builder = "binned_sah") {
  BuildSettings settings;
  settings.leaf = leaf, settings.threads = threads, settings.isa = isa, settings.parameters = parameters;
  settings.builder = builder;
  BuildReport report;
  auto accel = build_structure(structure, mesh, settings, report);
  CHECK(report.peak_bytes >= accel->bytes());
  return accel;
}

void add_triangle(TriangleMesh& mesh, Vec3f a, Vec3f b, Vec3f c) {
  const auto first = std::uint32_t(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), {a, b, c});
  mesh.triangles.push_back({first, first + 1, first + 2});
}

/// Rays aimed at inner points of triangles, from outside.
std::vector<Ray> rays_at(const TriangleMesh& mesh, std::size_t count) {
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < count; ++i) {
    const auto c = mesh.corners(random_bits(5, i, 0) % mesh.size());
    const Vec3f p = c[0] * 0.3f + c[1] * 0.3f + c[2] * 0.4f;
    const float size = length(c[1] - c[0]) + length(c[2] - c[0]);
    const Vec3f o = p + Vec3f{uniform(6, i, 0, -1, 1), uniform(6, i, 1, -1, 1), uniform(6, i, 2, -1, 1)} * (4 * size);
    rays.push_back({o, 0, p - o, kInfinity});
  }
  return rays;
}

/// Every runnable kernel of the BVHs with crack-free answers gives the oracle's hit for every ray.
void check_against_oracle(const TriangleMesh& mesh, const std::vector<Ray>& rays) {
  const Oracle oracle(mesh);
  const auto truth = oracle.closest_hit(rays);
  Structures structures(mesh);
  for (const KernelRow& row : runnable_rows()) {
    if (!row.structure.starts_with("bvh") || row.intersector != "watertight" || row.box != "padded") continue;
    const auto hits = closest_hit(row, structures.get(row), rays);
    const AnswerCheck check = oracle.check_closest_hit(rays, truth, hits);
    INFO(name_of(row));
    CAPTURE(check.missed_hits, check.false_hits, check.wrong_surface, check.wrong_primitive, check.cracks);
    CHECK(check.wrong_answers() == 0);
  }
}

}  // namespace

TEST_CASE("a tree holds every triangle once, inside its boxes, whatever the leaf and the collapse") {
  const TriangleMesh mesh = random_triangles(3001, 0.05f, 1);
  for (const char* structure : kBvhs) {
    for (std::string_view leaf : find_structure(structure)->info.leaves) {
      for (const char* builder : {"binned_sah", "morton"}) {  // the second may fill leaves before there are nodes
        for (const char* collapse : {"optimal", "greedy"}) {
          BuilderParameters p;
          p.collapse = collapse;
          const auto accel = build(structure, mesh, std::string(leaf).c_str(), 1, Isa::scalar, p, builder);
          Recorder seen(mesh);
          REQUIRE(accel->visit(seen));
          INFO(structure << " " << leaf << " " << builder << " " << collapse);
          CHECK(seen.every_triangle_once());
          CHECK(seen.boxes_hold());
        }
      }
    }
  }
}

TEST_CASE("the tree is the same for any number of threads and on any ISA") {
  const TriangleMesh mesh = random_triangles(150000, 0.01f, 2);  // large enough for the parallel splits
  for (const char* builder : {"binned_sah", "morton"}) {
    std::uint64_t expected = 0;
    for (Isa isa : available_isas()) {
      for (unsigned threads : {1u, 2u, 5u}) {
        const auto accel = build("bvh8", mesh, "triangle4", threads, isa, {}, builder);
        Recorder seen(mesh);
        REQUIRE(accel->visit(seen));
        if (expected == 0) expected = seen.hash();
        INFO(builder << " " << to_string(isa) << " threads " << threads);
        CHECK(seen.hash() == expected);
        CHECK(seen.every_triangle_once());
      }
    }
  }
}

TEST_CASE("optimal collapse costs no more than greedy collapse") {
  // On the sphere a collapse that cannot open a leaf again loses to greedy collapse.
  for (const TriangleMesh& mesh : {random_triangles(5000, 0.03f, 3), sphere(80)}) {
    for (const char* structure : kBvhs) {
      const auto cost = [&](const char* collapse) {
        struct Cost final : StructureVisitor {
          double sum = 0;
          void node(const NodeView& n) override { sum += n.bounds.area(); }
          void leaf(const LeafView& l) override { sum += l.bounds.area() * l.blocks; }
        } visitor;
        BuilderParameters p;
        p.collapse = collapse;
        REQUIRE(build(structure, mesh, "triangle4", 1, Isa::scalar, p)->visit(visitor));
        return visitor.sum;
      };
      INFO(structure);
      CHECK(cost("optimal") <= cost("greedy") * 1.000001);
    }
  }
}

TEST_CASE("leaves filled by fours are the blocks that are filled one by one") {
  TriangleMesh mesh = random_triangles(200, 0.5f, 8);
  add_triangle(mesh, {0, 0, 0}, {1, 1, 1}, {2, 2, 2});                             // flat
  add_triangle(mesh, {1, 2, 3}, {1, 2, 3}, {4, 5, 7});                             // flat
  add_triangle(mesh, {3, 1, 0}, {3, 2, 0}, {3, 1, 5});                             // a wall: flat in two projections
  add_triangle(mesh, {0, 0, 0}, {1e-25f, 0, 0}, {0, 1e-25f, 0});                   // its products underflow in float
  add_triangle(mesh, {0, 0, 0}, {1e30f, 0, 0}, {0, 1e30f, 0});                     // they overflow
  add_triangle(mesh, {0, 0, 0}, {1, 1, 1}, {1 + 0x1p-22f, 1 + 0x1p-23f, 1});       // a sliver
  add_triangle(mesh, {0.1f, 0.1f, 0.1f}, {0.2f, 0.2f, 0.2f}, {0.3f, 0.3f, 0.3f});  // flat or not, by rounding
  std::size_t different = 0, flat = 0, not_bounds = 0;
  for_each_type(AllBlocks{}, [&]<class Block>(std::type_identity<Block>) {
    if constexpr (Block::kForm == TriangleForm::edges || Block::kForm == TriangleForm::vertices) {
      std::vector<std::uint32_t> ids;
      // Whole and partly filled blocks, special triangles in every lane
      for (std::uint32_t last = std::uint32_t(mesh.size()); last-- > 0;) {
        ids.push_back(last);
        if (ids.size() > 33) ids.erase(ids.begin());
        alignas(64) std::byte a[34 * sizeof(Block)], b[34 * sizeof(Block)], c[34 * sizeof(Block)];
        const auto* form = find_leaf_form(Block::kName);
        REQUIRE(form != nullptr);
        form->fill(a, mesh, ids);
        fill_blocks(reinterpret_cast<Block*>(b), mesh, ids);
        Box4 box;
        form->fill_and_extend(c, mesh, ids, box);
        Bounds3f bounds;
        for (const std::uint32_t id : ids) bounds.extend(mesh.bounds(id));
        not_bounds += to_vec3f(box.lower) != bounds.lower || to_vec3f(box.upper) != bounds.upper;
        different += std::memcmp(a, c, (ids.size() + Block::kWidth - 1) / Block::kWidth * sizeof(Block)) != 0;
        const std::size_t words = (ids.size() + Block::kWidth - 1) / Block::kWidth * sizeof(Block) / 4;
        for (std::size_t i = 0; i < words; ++i) {
          std::uint32_t x, y;
          std::memcpy(&x, a + 4 * i, 4), std::memcpy(&y, b + 4 * i, 4);
          const bool nan = std::isnan(std::bit_cast<float>(x)) && std::isnan(std::bit_cast<float>(y));
          different += x != y && !nan, flat += nan;
        }
      }
    }
  });
  CHECK(different == 0);
  CHECK(not_bounds == 0);
  CHECK(flat > 0);
}

TEST_CASE("empty and tiny scenes") {
  for (const char* structure : kBvhs) {
    for (std::size_t n : {0, 1, 2, 3, 4, 5, 16, 17}) {
      const TriangleMesh mesh = random_triangles(n, 0.5f, 7);
      const auto accel = build(structure, mesh, "triangle4v");
      Recorder seen(mesh);
      REQUIRE(accel->visit(seen));
      INFO(structure << " " << n);
      CHECK(seen.every_triangle_once());
      if (n == 1) CHECK((seen.nodes == 0 && seen.leaves == 1));  // the root is a leaf
    }
  }
  const TriangleMesh empty;
  Structures structures(empty);
  const std::vector<Ray> rays{{{0, 0, 0}, 0, {0, 0, 1}, kInfinity}, {{1, 2, 3}, 0, {-1, 0, 0}, kInfinity}};
  for (const KernelRow& row : runnable_rows()) {
    for (const Hit& h : closest_hit(row, structures.get(row), rays)) CHECK_FALSE(h.is_hit());
  }
}

TEST_CASE("many copies of one triangle end in many leaves, and the lowest id is hit") {
  for (std::size_t copies : {2, 33, 1000, 10000}) {
    TriangleMesh mesh;
    for (std::size_t i = 0; i < copies; ++i) add_triangle(mesh, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});
    const std::vector<Ray> rays{{{0.2f, 0.2f, 1}, 0, {0, 0, -1}, kInfinity}};
    Structures structures(mesh);
    for (const KernelRow& row : runnable_rows()) {
      if (!row.structure.starts_with("bvh")) continue;
      const auto hits = closest_hit(row, structures.get(row), rays);
      INFO(name_of(row) << " " << copies);
      CHECK(hits[0].primitive == 0);
      CHECK(hits[0].t == 1.0f);
    }
  }
}

TEST_CASE("concentric triangles of all sizes: every centroid is the same") {
  TriangleMesh mesh;
  for (int k = -20; k <= 36; ++k) {
    const float s = std::ldexp(1.0f, k);
    add_triangle(mesh, {-s, -s, 0}, {s, -s, 0}, {0, 2 * s, 0});
  }
  check_against_oracle(mesh, rays_at(mesh, 500));
}

TEST_CASE("triangles at powers of two: a tree too deep for a small fixed stack") {
  TriangleMesh mesh;
  for (int i = -38; i <= 38; ++i) {
    const float x = std::ldexp(1.0f, i), s = std::ldexp(1.0f, i - 2);
    for (int k = 0; k < 9; ++k)
      add_triangle(mesh, {x, 0, 0.01f * k * s}, {x + s, 0, 0.01f * k * s}, {x, s, 0.01f * k * s});
  }
  BuilderParameters p;
  p.bins = 4, p.max_leaf_blocks = 1;
  const auto accel = build("bvh2", mesh, "triangle1", 1, Isa::scalar, p);
  Recorder seen(mesh);
  REQUIRE(accel->visit(seen));
  CHECK(seen.depth > 20);
  CHECK(seen.every_triangle_once());
  check_against_oracle(mesh, rays_at(mesh, 500));
}

TEST_CASE("a far outlier leaves the rest in one bin") {
  TriangleMesh mesh = random_triangles(20000, 0.01f, 11);
  add_triangle(mesh, {1e12f, 0, 0}, {1e12f, 1e6f, 0}, {1e12f, 0, 1e6f});
  for (const char* structure : kBvhs) {
    const auto accel = build(structure, mesh, "triangle4");
    Recorder seen(mesh);
    REQUIRE(accel->visit(seen));
    CHECK(seen.every_triangle_once());
    CHECK(seen.largest_leaf <= 32);
  }
}

TEST_CASE("flat grids: boxes of no thickness are hit at nodes, edges and cell centres") {
  for (std::uint32_t n : {1u, 2u, 16u, 64u}) {
    const TriangleMesh mesh = flat_grid(n);
    std::vector<Ray> rays;
    for (std::uint32_t y = 0; y <= 2 * n; ++y) {
      for (std::uint32_t x = 0; x <= 2 * n; ++x) {
        rays.push_back({{float(x) / float(n) - 1, float(y) / float(n) - 1, 3}, 0, {0, 0, -1}, kInfinity});
      }
    }
    check_against_oracle(mesh, rays);
  }
}

TEST_CASE("axis-parallel rays visit a path, not the whole tree") {
  const TriangleMesh mesh = flat_grid(128);  // 32 768 triangles
  Structures structures(mesh);
  const std::vector<Ray> rays{{{0, 0, 3}, 0, {0, 0, -1}, kInfinity}, {{0.5f, 0.25f, 3}, 0, {0, -0.0f, -1}, kInfinity}};
  for (const KernelRow& row : runnable_rows()) {
    if (!row.structure.starts_with("bvh")) continue;
    Counters counters;
    (void)closest_hit(row, structures.get(row), rays, &counters);
    INFO(name_of(row));
    CHECK(counters.nodes < 400);
  }
}

TEST_CASE("settings out of range are refused in one line") {
  const TriangleMesh mesh = random_triangles(10, 0.1f, 1);
  BuilderParameters p;
  p.max_leaf_blocks = 9;
  CHECK_THROWS_AS(build("bvh8", mesh, "triangle4", 1, Isa::scalar, p), UserError);
  p = {}, p.bins = 3;
  CHECK_THROWS_AS(build("bvh8", mesh, "triangle4", 1, Isa::scalar, p), UserError);
  p = {}, p.collapse = "gready";
  CHECK_THROWS_AS(build("bvh8", mesh, "triangle4", 1, Isa::scalar, p), UserError);
  CHECK_THROWS_AS(build("bvh8", mesh, "triangle5"), UserError);
  CHECK_THROWS_AS(build("bhv8", mesh, "triangle4"), UserError);
}
