// Building the kd-tree: that clipping loses no reference, that duplicates, depth and memory are bounded, and that both
// builders make the same tree for any number of threads. Its rays: tests/test_kdtree_rays.cpp.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "core/error.h"
#include "structures/accel.h"
#include "structures/kdtree/clip.h"
#include "structures/kdtree/kdtree.h"
#include "structures/kdtree/split.h"
#include "tests/kdtree_scenes.h"

using namespace arboretum;
using namespace arboretum::test::kd;
using arboretum::test::random_triangles;

namespace {

constexpr std::size_t kMostReferences = 8;  // times the triangles: the bound that docs/structures.md states

/// What a visitor sees: references of each triangle, whether cells tile their parents, whether a triangle's leaves
/// cover it.
class Recorder final : public StructureVisitor {
 public:
  explicit Recorder(const TriangleMesh& mesh) : mesh_(mesh), leaves_of_(mesh.size()) {}
  void node(const NodeView& n) override {
    put(n.depth), put(n.bounds);
    REQUIRE(n.child_bounds.size() == 2);
    Bounds3f both = n.child_bounds[0];
    both.extend(n.child_bounds[1]);
    tiled_ = tiled_ && both == n.bounds && !n.child_bounds[0].empty() && !n.child_bounds[1].empty();
    put(n.child_bounds[0]);
    ++nodes;
  }
  void leaf(const LeafView& l) override {
    put(l.depth), put(l.bounds);
    depth = std::max(depth, l.depth);
    largest_leaf = std::max(largest_leaf, l.primitives.size());
    std::vector<std::uint32_t> ids(l.primitives.begin(), l.primitives.end());
    for (std::uint32_t id : ids) put(id), leaves_of_.at(id).push_back(l.bounds);
    std::sort(ids.begin(), ids.end());
    once_ = once_ && std::adjacent_find(ids.begin(), ids.end()) == ids.end();
    references += ids.size();
    ++leaves;
  }
  [[nodiscard]] bool cells_tile() const { return tiled_; }
  [[nodiscard]] bool once_a_leaf() const { return once_; }
  [[nodiscard]] std::uint64_t hash() const { return hash_; }

  /// Points of triangles (corners, edge points, inner points) that no leaf of the triangle holds; a point counts as
  /// held within 2^-20 of the scene's largest coordinate, far less than any cell here is wide.
  [[nodiscard]] std::size_t lost_points() const {
    const Bounds3f scene = mesh_.bounds();
    double slack = 0;
    for (std::size_t k = 0; k < 3; ++k)
      slack = std::max({slack, 0x1p-20 * std::abs(scene.lower[k]), 0x1p-20 * std::abs(scene.upper[k])});
    std::size_t lost = 0;
    for (std::size_t t = 0; t < mesh_.size(); ++t) {
      const auto c = mesh_.corners(t);
      for (int i = 0; i <= 6; ++i) {
        for (int j = 0; i + j <= 6; ++j) {
          double p[3];
          for (std::size_t k = 0; k < 3; ++k)
            p[k] = (double(c[0][k]) * i + double(c[1][k]) * j + double(c[2][k]) * (6 - i - j)) / 6;
          lost += std::ranges::none_of(leaves_of_[t], [&](const Bounds3f& cell) {
            for (std::size_t k = 0; k < 3; ++k) {
              if (p[k] < cell.lower[k] - slack || p[k] > cell.upper[k] + slack) return false;
            }
            return true;
          });
        }
      }
    }
    return lost;
  }
  std::size_t nodes = 0, leaves = 0, references = 0, largest_leaf = 0;
  unsigned depth = 0;

 private:
  void put(std::uint64_t x) { hash_ = mix64(hash_ ^ x); }
  void put(const Bounds3f& b) {
    for (std::size_t k = 0; k < 3; ++k)
      put(std::bit_cast<std::uint32_t>(b.lower[k])), put(std::bit_cast<std::uint32_t>(b.upper[k]));
  }
  const TriangleMesh& mesh_;
  std::vector<std::vector<Bounds3f>> leaves_of_;
  std::uint64_t hash_ = 1;
  bool tiled_ = true, once_ = true;
};

}  // namespace

TEST_CASE("clipping keeps what is in the box, to the last bit outward") {
  using kdtree::clipped_bounds;
  const std::array<Vec3f, 3> t{Vec3f{0, 0, 0}, Vec3f{4, 0, 0}, Vec3f{0, 4, 0}};
  CHECK(clipped_bounds(t, {{-1, -1, -1}, {5, 5, 5}}) == Bounds3f{{0, 0, 0}, {4, 4, 0}});
  CHECK(clipped_bounds(t, {{1, 1, -1}, {5, 5, 5}}) == Bounds3f{{1, 1, 0}, {3, 3, 0}});
  CHECK(clipped_bounds(t, {{3, 0, 0}, {3, 5, 0}}) == Bounds3f{{3, 0, 0}, {3, 1, 0}});    // a box without thickness
  CHECK(clipped_bounds(t, {{4, -1, -1}, {5, 5, 5}}) == Bounds3f{{4, 0, 0}, {4, 0, 0}});  // a corner on its face
  CHECK(clipped_bounds(t, {{2, 2, 0}, {5, 5, 5}}) == Bounds3f{{2, 2, 0}, {2, 2, 0}});    // an edge on its edge
  CHECK(clipped_bounds(t, {{2.5f, 2.5f, -1}, {5, 5, 5}}).empty());                       // beside the long edge
  CHECK(clipped_bounds(t, {{-1, -1, 1}, {5, 5, 5}}).empty());
  for (std::size_t i = 0; i < 20000; ++i) {
    Dice dice(i);
    const float scale = dice.exponential(-30, 30);
    std::array<Vec3f, 3> c;
    for (Vec3f& v : c) v = dice.point() * scale;
    Bounds3f box;
    box.extend(dice.point() * scale), box.extend(dice.point() * scale);
    const Bounds3f got = clipped_bounds(c, box);
    if (!got.empty()) REQUIRE(box.contains(got));
    const int axis = dice.integer(3);
    const auto a = std::size_t(axis);
    const float plane = box.lower[a] + (box.upper[a] - box.lower[a]) * dice.uniform(0, 1);
    Bounds3f halves[2] = {box, box}, parts[2];
    halves[0].upper[a] = halves[1].lower[a] = plane;
    clipped_bounds(c, box, axis, plane, parts[0], parts[1]);
    for (int side = 0; side < 2; ++side) {  // as clipped one by one, but for the rounding of a corner that is cut twice
      const Bounds3f alone = clipped_bounds(c, halves[side]);
      REQUIRE(parts[side].empty() == alone.empty());
      if (alone.empty()) continue;
      REQUIRE(halves[side].contains(parts[side]));
      for (std::size_t k = 0; k < 3; ++k) {
        REQUIRE(std::abs(parts[side].lower[k] - alone.lower[k]) <= 0x1p-20f * std::abs(scale));
        REQUIRE(std::abs(parts[side].upper[k] - alone.upper[k]) <= 0x1p-20f * std::abs(scale));
      }
    }
    // No point of the triangle in the box is outside the result, but for double rounding
    for (int k = 0; k < 40; ++k) {
      double w[3] = {dice.uniform(0, 1), dice.uniform(0, 1), 0};
      if (w[0] + w[1] > 1) w[0] = 1 - w[0], w[1] = 1 - w[1];
      w[2] = 1 - w[0] - w[1];
      bool in_box = true, in_result = true;
      for (std::size_t a = 0; a < 3; ++a) {
        const double p = w[0] * c[0][a] + w[1] * c[1][a] + w[2] * c[2][a], slack = std::abs(double(scale)) * 0x1p-48;
        in_box = in_box && p >= box.lower[a] + slack && p <= box.upper[a] - slack;
        in_result = in_result && p >= got.lower[a] - slack && p <= got.upper[a] + slack;
      }
      if (in_box) REQUIRE(in_result);
    }
  }
}

TEST_CASE("a reference that a plane cuts is never lost") {
  for (std::size_t i = 0; i < 20000; ++i) {
    Dice dice(i);
    TriangleMesh mesh;
    const Vec3f a = dice.point(), b = dice.point();
    // Slivers, points of a cut at a corner, ordinary triangles.
    add_triangle(mesh, a, b, i % 3 == 0 ? a * 0.3f + b * 0.7f : i % 3 == 1 ? Vec3f{a.x, b.y, a.z} : dice.point());
    Bounds3f cell = mesh.bounds(), box = cell;
    for (int cuts = 0; cuts < 6; ++cuts) {
      kdtree::Split split;
      split.axis = dice.integer(3);
      const auto k = std::size_t(split.axis);
      split.plane = i % 2 ? std::nextafter(box.lower[k], 2.0f)
                          : box.lower[k] + (box.upper[k] - box.lower[k]) * dice.uniform(0, 1);
      if (side_of(box, split) != kdtree::Side::both) continue;
      Bounds3f left, right;
      divide_reference(mesh, BoxPads(mesh, mesh.bounds()), {box, 0}, split, cell, left, right);
      REQUIRE_FALSE((left.empty() && right.empty()));
      if (!left.empty()) REQUIRE(left_of(cell, split).contains(left));
      if (!right.empty()) REQUIRE(right_of(cell, split).contains(right));
      const bool go_left = right.empty() || (!left.empty() && dice.integer(2) == 0);
      box = go_left ? left : right, cell = go_left ? left_of(cell, split) : right_of(cell, split);
    }
  }
}

TEST_CASE("leaves cover every triangle, cells tile, duplicates and depth are bounded") {
  for (const Scene& scene : hard_scenes()) {
    for (const char* builder : kBuilders) {
      for (float intersection_cost : {1.0f, 1000.0f}) {  // at 1000 the tree is split as far as the bounds let it
        BuilderParameters p;
        p.intersection_cost = intersection_cost;
        const auto accel = build(scene.mesh, builder, "triangle1", 1, p);
        Recorder seen(scene.mesh);
        REQUIRE(accel->visit(seen));
        INFO(scene.name << " " << builder << " " << intersection_cost << ": " << seen.references
                        << " references, depth " << seen.depth);
        CHECK(seen.cells_tile());
        CHECK(seen.once_a_leaf());
        CHECK(seen.lost_points() == 0);
        CHECK(seen.references <= kMostReferences * scene.mesh.size());
        CHECK(seen.depth <= unsigned(8 + 1.3 * std::log2(double(scene.mesh.size()) + 1)));
        CHECK(seen.leaves == seen.nodes + 1);
      }
    }
  }
}

TEST_CASE("a scene wider than floats go is split as a narrower one is") {
  constexpr float kMost = std::numeric_limits<float>::max();
  const auto scaled = [](float by) {
    TriangleMesh mesh = random_triangles(3000, 0.02f, 5);
    for (Vec3f& p : mesh.vertices) p = {p.x * by, p.y * by, p.z * by};
    return mesh;
  };
  const TriangleMesh unit = scaled(1.0f);
  const Bounds3f box = unit.bounds();
  float reach = 0;
  for (std::size_t k = 0; k < 3; ++k) reach = std::max({reach, -box.lower[k], box.upper[k]});
  const TriangleMesh narrow = scaled(0.25f * kMost / reach), wide = scaled(kMost / reach * 0.999f);
  for (std::size_t k = 0; k < 3; ++k) REQUIRE(std::isinf(wide.bounds().upper[k] - wide.bounds().lower[k]));
  for (const char* builder : kBuilders) {
    INFO(builder);
    Recorder of_narrow(narrow), of_wide(wide);
    REQUIRE(build(narrow, builder)->visit(of_narrow));
    REQUIRE(build(wide, builder)->visit(of_wide));
    CAPTURE(of_wide.leaves, of_narrow.leaves);
    CHECK(of_narrow.leaves > 300);
    CHECK(10 * of_wide.leaves > 8 * of_narrow.leaves);
    CHECK(10 * of_wide.references < 12 * of_narrow.references);
    CHECK(of_wide.cells_tile());
    CHECK(of_wide.lost_points() == 0);
  }
}

TEST_CASE("max_depth bounds the deepest leaf, and the tree is complete") {
  const TriangleMesh mesh = random_triangles(2000, 0.05f, 1);
  for (const char* builder : kBuilders) {
    for (unsigned depth : {1u, 2u, 7u, 40u}) {
      BuilderParameters p;
      p.max_depth = depth, p.intersection_cost = 100;
      Recorder seen(mesh);
      REQUIRE(build(mesh, builder, "triangle1", 1, p)->visit(seen));
      INFO(builder << " " << depth);
      CHECK(seen.depth <= depth);
      if (depth <= 7) CHECK(seen.depth == depth);
      CHECK(seen.lost_points() == 0);
    }
  }
}

TEST_CASE("both builders make the same tree for any number of threads") {
  const TriangleMesh mesh = random_triangles(60000, 0.02f, 2);  // large enough for the parallel splits
  for (const char* builder : kBuilders) {
    std::uint64_t expected = 0;
    for (unsigned threads : {1u, 2u, 5u}) {
      Recorder seen(mesh);
      REQUIRE(build(mesh, builder, "triangle8", threads)->visit(seen));
      if (expected == 0) expected = seen.hash();
      INFO(builder << " threads " << threads);
      CHECK(seen.hash() == expected);
    }
  }
}

TEST_CASE("a node's link and a leaf's blocks come back as they went in") {
  using kdtree::Node;
  for (std::size_t offset : {std::size_t{0}, std::size_t{16}, Node::kMostBytes - 16}) {
    for (int axis = 0; axis < 3; ++axis) {
      const Node n = Node::inner(-0.5f, axis, offset);
      CHECK((!n.is_leaf() && n.axis() == axis && n.offset() == offset && n.split == -0.5f));
    }
    for (std::uint32_t blocks : {0u, 1u, 0x7fc00001u}) {
      const Node n = Node::leaf(blocks, offset);
      CHECK((n.is_leaf() && n.blocks() == blocks && n.offset() == (blocks ? offset : 0)));
      CHECK((std::bit_cast<std::uint64_t>(n) == kdtree::kEmptyCell) == (blocks == 0));
    }
  }
}

TEST_CASE("settings out of range are refused in one line") {
  const TriangleMesh mesh = random_triangles(10, 0.1f, 1);
  const auto refused = [&](auto change) {
    BuilderParameters p;
    change(p);
    CHECK_THROWS_AS(build(mesh, "binned_sah", "triangle4", 1, p), UserError);
  };
  refused([](BuilderParameters& p) { p.bins = 3; });
  refused([](BuilderParameters& p) { p.bins = 65; });
  refused([](BuilderParameters& p) { p.max_depth = 64; });
  refused([](BuilderParameters& p) { p.empty_bonus = 1.0f; });
  refused([](BuilderParameters& p) { p.empty_bonus = std::nanf(""); });
  refused([](BuilderParameters& p) { p.max_leaf_blocks = 0; });
  CHECK_THROWS_AS(build(mesh, "spatial_sah"), UserError);
  CHECK_THROWS_AS(build(mesh, "binned_sah", "triangle5"), UserError);
}
