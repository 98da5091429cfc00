#include "structures/accel.h"
#include "structures/statistics.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <vector>

#include "core/random.h"
#include "scenes/generators/generators.h"
#include "structures/end_point_overlap.h"
#include "structures/leaf_count_variability.h"
#include "tests/catch.h"
#include "tests/small_meshes.h"

using namespace arboretum;

namespace {

/// A tree written down by hand: a node has children, a leaf primitives.
struct Branch {
  std::vector<Branch> children;
  std::vector<std::uint32_t> primitives;
};

Bounds3f bounds_of(const TriangleMesh& mesh, const Branch& branch) {
  Bounds3f box;
  for (const Branch& child : branch.children) box.extend(bounds_of(mesh, child));
  for (std::uint32_t i : branch.primitives) box.extend(mesh.bounds(i));
  return box;
}

/// Shows a Branch to visitors: 100 bytes a node, 10 a leaf, blocks of two triangles.
class HandMade final : public Accel {
 public:
  HandMade(const TriangleMesh& mesh, Branch root, bool visible = true)
      : mesh_(mesh), root_(std::move(root)), visible_(visible) {}
  const StructureInfo& info() const noexcept override { return info_; }
  void build(const TriangleMesh&, const BuildSettings&, BuildReport&) override {}
  bool visit(StructureVisitor& visitor) const override {
    if (visible_ && (!root_.children.empty() || !root_.primitives.empty())) show(visitor, root_, 0);
    return visible_;
  }
  std::size_t bytes() const noexcept override { return 1234; }

 private:
  void show(StructureVisitor& visitor, const Branch& branch, unsigned depth) const {
    if (branch.children.empty()) {
      const auto blocks = static_cast<unsigned>((branch.primitives.size() + 1) / 2);
      visitor.leaf({bounds_of(mesh_, branch), branch.primitives, depth, blocks, 2, 10});
      return;
    }
    std::vector<Bounds3f> boxes;
    for (const Branch& child : branch.children) boxes.push_back(bounds_of(mesh_, child));
    visitor.node({bounds_of(mesh_, branch), boxes, depth, 100});
    for (const Branch& child : branch.children) show(visitor, child, depth + 1);
  }

  const TriangleMesh& mesh_;
  Branch root_;
  bool visible_;
  StructureInfo info_;
};

Branch leaf(std::vector<std::uint32_t> primitives) { return {{}, std::move(primitives)}; }

/// Two triangles of area 2 in z = 0; each has an area of 0.5 in the other's box (2 by 2). All of it is 3
/// by 2.
TriangleMesh two_that_overlap() {
  TriangleMesh mesh;
  add_triangle(mesh, {0, 0, 0}, {2, 0, 0}, {0, 2, 0});
  add_triangle(mesh, {1, 0, 0}, {3, 0, 0}, {3, 2, 0});
  return mesh;
}

TriangleMesh random_mesh(std::uint32_t count, float size) {
  TriangleMesh mesh;
  for (std::uint32_t i = 0; i < count; ++i) {
    float r[12];
    for (std::uint64_t k = 0; k < 12; ++k) r[k] = random_float(3, i, k);
    const Vec3f c{r[0], r[1], r[2]};
    add_triangle(mesh, c + Vec3f{r[3], r[4], r[5]} * size, c + Vec3f{r[6], r[7], r[8]} * size,
                 c + Vec3f{r[9], r[10], r[11]} * size);
  }
  return mesh;
}

/// Halves the triangles by the first corner, axis after axis.
Branch halved(const TriangleMesh& mesh, std::vector<std::uint32_t> ids, std::size_t axis = 0) {
  if (ids.size() <= 2) return leaf(ids);
  std::sort(ids.begin(), ids.end(),
            [&](std::uint32_t a, std::uint32_t b) { return mesh.corners(a)[0][axis] < mesh.corners(b)[0][axis]; });
  const auto middle = ids.begin() + static_cast<std::ptrdiff_t>(ids.size() / 2);
  return {{halved(mesh, {ids.begin(), middle}, (axis + 1) % 3), halved(mesh, {middle, ids.end()}, (axis + 1) % 3)}, {}};
}

/// The records of a hand-made tree, as end_point_overlap takes them.
std::uint32_t write_records(const TriangleMesh& mesh, const Branch& branch, std::vector<TreeRecord>& records,
                            std::vector<std::uint32_t>& references) {
  const std::size_t index = records.size();
  records.push_back({bounds_of(mesh, branch), branch.children.empty() ? 1.0 * branch.primitives.size() : 1.0, 0,
                     static_cast<std::uint32_t>(references.size()), 0, branch.children.empty()});
  references.insert(references.end(), branch.primitives.begin(), branch.primitives.end());
  for (const Branch& child : branch.children) write_records(mesh, child, records, references);
  records[index].end = static_cast<std::uint32_t>(records.size());
  records[index].end_reference = static_cast<std::uint32_t>(references.size());
  return records[index].end;
}

}  // namespace

TEST_CASE("area of a triangle within a box") {
  const std::array<Vec3f, 3> triangle{Vec3f{0, 0, 0}, Vec3f{2, 0, 0}, Vec3f{0, 2, 0}};
  struct Case {
    const char* name;
    Bounds3f box;
    double area;
  };
  const Case cases[] = {
      {"all of it", {{-1, -1, -1}, {3, 3, 1}}, 2.0},
      {"its own flat box", {{0, 0, 0}, {2, 2, 0}}, 2.0},
      {"right of x = 1", {{1, 0, 0}, {2, 2, 0}}, 0.5},
      {"a square in the corner", {{0, 0, -1}, {1, 1, 1}}, 1.0},
      {"a square less its corner", {{0.5f, 0.5f, -1}, {1.25f, 1.25f, 1}}, 0.75 * 0.75 - 0.5 * 0.5 * 0.5},
      {"cut by four planes", {{0.25f, 0.25f, -1}, {1.5f, 1.5f, 1}}, 1.25 * 1.25 - 0.5 * 1.0 * 1.0},
      {"beside it", {{3, 0, -1}, {4, 1, 1}}, 0.0},
      {"above it", {{0, 0, 1}, {2, 2, 2}}, 0.0},
      {"touching along an edge", {{-1, -1, -1}, {0, 3, 1}}, 0.0},
      {"the corner of the box alone", {{1, 1, -1}, {2, 2, 1}}, 0.0},
  };
  for (const Case& c : cases) {
    INFO(c.name);
    CHECK(clipped_area(triangle, c.box) == Approx(c.area).margin(1e-15));
  }
}

TEST_CASE("a node over two leaves, by hand") {
  const TriangleMesh mesh = two_that_overlap();
  BuilderParameters costs;
  costs.traversal_cost = 1.5f;
  costs.intersection_cost = 2.0f;
  const StructureStatistics s = compute_statistics(HandMade(mesh, {{leaf({0}), leaf({1})}, {}}), mesh, costs, true);
  CHECK(s.available);
  CHECK(s.nodes == 1);
  CHECK(s.leaves == 2);
  CHECK(s.references == 2);
  CHECK(s.blocks == 2);
  CHECK(s.depth == 1);
  CHECK(s.bytes == 1234);
  CHECK(s.node_bytes == 100);
  CHECK(s.leaf_bytes == 20);
  CHECK(s.leaf_fill == 0.5);
  CHECK(s.duplication == 1.0);
  CHECK(s.children_per_node == 2.0);
  CHECK(s.depth_histogram == std::vector<std::size_t>{0, 2});
  CHECK(s.sah_cost == Approx(1.5 + 2 * 2.0 * 8.0 / 12.0));
  CHECK(s.sah_child_cost == Approx(2 * 1.5 + 2 * 2.0 * 8.0 / 12.0));
  CHECK(s.epo == Approx((2.0 * 0.5 + 2.0 * 0.5) / 4.0));
  CHECK(s.epo_sampled == 1.0);
  const StructureStatistics without =
      compute_statistics(HandMade(mesh, {{leaf({0}), leaf({1})}, {}}), mesh, costs, false);
  CHECK(without.epo == 0.0);
  CHECK(without.sah_cost == s.sah_cost);
}

TEST_CASE("a root that is a leaf, an empty structure, one that shows nothing") {
  const TriangleMesh mesh = two_that_overlap();
  const BuilderParameters costs;
  const StructureStatistics one = compute_statistics(HandMade(mesh, leaf({0, 1})), mesh, costs, true);
  CHECK(one.nodes == 0);
  CHECK(one.leaves == 1);
  CHECK(one.depth == 0);
  CHECK(one.leaf_fill == 1.0);
  CHECK(one.sah_cost == 1.0);
  CHECK(one.epo == 0.0);
  const StructureStatistics empty = compute_statistics(HandMade({}, {}), {}, costs, true);
  CHECK(empty.available);
  CHECK(empty.sah_cost == 0.0);
  CHECK(empty.epo == 0.0);
  const StructureStatistics hidden = compute_statistics(HandMade(mesh, leaf({0, 1}), false), mesh, costs, true);
  CHECK_FALSE(hidden.available);
  CHECK(hidden.bytes == 1234);
}

TEST_CASE("a shared triangle belongs to both leaves and counts once against others") {
  TriangleMesh mesh = two_that_overlap();
  const BuilderParameters costs;
  // Triangle 1 in both leaves: only the second leaf has something foreign, triangle 0.
  const StructureStatistics s = compute_statistics(HandMade(mesh, {{leaf({0, 1}), leaf({1})}, {}}), mesh, costs, true);
  CHECK(s.duplication == 1.5);
  CHECK(s.epo == Approx(0.5 / 4.0));
  // A third, far from the others, twice within the root's box: it is foreign to neither box.
  add_triangle(mesh, {0, 0, 10}, {1, 0, 10}, {0, 1, 10});
  const StructureStatistics t =
      compute_statistics(HandMade(mesh, {{{{leaf({0}), leaf({1})}, {}}, leaf({2}), leaf({2})}, {}}), mesh, costs, true);
  CHECK(t.epo == Approx((0.5 + 0.5) / 4.5));
  CHECK(t.depth_histogram == std::vector<std::size_t>{0, 2, 2});
  CHECK(t.children_per_node == 2.5);
}

TEST_CASE("an inner node pays for what is foreign to it") {
  TriangleMesh mesh = two_that_overlap();
  add_triangle(mesh, {0, 0, 0}, {1, 0, 0}, {0, 1, 0});  // area 0.5, wholly in triangle 0's box
  BuilderParameters costs;
  costs.traversal_cost = 3.0f;
  const StructureStatistics s =
      compute_statistics(HandMade(mesh, {{{{leaf({0}), leaf({1})}, {}}, leaf({2})}, {}}), mesh, costs, true);
  // The inner node's box holds triangle 2; leaf 0's holds it and half of triangle 1; leaf 1's half of
  // triangle 0; leaf 2's the square [0,1] x [0,1], all of which triangle 0 covers.
  CHECK(s.epo == Approx((3.0 * 0.5 + (0.5 + 0.5) + 0.5 + 1.0) / 4.5));
}

TEST_CASE("boxes that part space have no end-point overlap, to the last bit") {
  const TriangleMesh mesh = generate_sphere(2000, 1).mesh;  // clipping rounds what touches some of its cells
  for (const char* structure : {"kdtree", "octree", "grid"}) {
    BuildReport report;
    BuildSettings settings;
    settings.builder = find_structure(structure)->info.builders.front();
    const auto accel = build_structure(structure, mesh, settings, report);
    INFO(structure);
    CHECK(compute_statistics(*accel, mesh, {}, true).epo == 0.0);
  }
}

TEST_CASE("a scene without area has costs, not NaN") {
  TriangleMesh line;
  add_triangle(line, {0, 0, 0}, {1, 0, 0}, {2, 0, 0});
  add_triangle(line, {5, 0, 0}, {6, 0, 0}, {7, 0, 0});
  const StructureStatistics s = compute_statistics(HandMade(line, {{leaf({0}), leaf({1})}, {}}), line, {}, true);
  CHECK(s.sah_cost == 3.0);
  CHECK(s.epo == 0.0);
}

TEST_CASE("end-point overlap equals the definition, and its estimate comes near") {
  const TriangleMesh mesh = random_mesh(3000, 0.2f);
  std::vector<std::uint32_t> all(mesh.size());
  std::iota(all.begin(), all.end(), 0u);
  const Branch root = halved(mesh, all);
  std::vector<TreeRecord> records;
  std::vector<std::uint32_t> references;
  write_records(mesh, root, records, references);

  double sum = 0.0, area = 0.0;
  for (std::size_t i = 0; i < mesh.size(); ++i) area += clipped_area(mesh.corners(i), mesh.bounds(i));
  for (const TreeRecord& record : records) {
    for (std::uint32_t r = 0; r < references.size(); ++r) {
      if (r >= record.first_reference && r < record.end_reference) continue;
      sum += record.cost * clipped_area(mesh.corners(references[r]), record.bounds);
    }
  }
  const EndPointOverlap exact = end_point_overlap(mesh, records, references);
  CHECK(exact.sampled == 1.0);
  CHECK(exact.value == Approx(sum / area).epsilon(1e-9));
  CHECK(exact.value > 1.0);
  const EndPointOverlap estimate = end_point_overlap(mesh, records, references, 3e6);
  CHECK(estimate.sampled < 0.5);
  CHECK(estimate.value == Approx(exact.value).epsilon(0.05));
  CHECK(end_point_overlap(mesh, records, references, 3e6).value == estimate.value);
}

TEST_CASE("leaf-count variability: its mean is the SAH's leaf share, its deviation that of chords") {
  SECTION("one leaf, no leaf, leaves that fill the box") {
    const Bounds3f box{{0, 0, 0}, {1, 2, 3}};
    CHECK(leaf_counts({}).lines == 0);
    const TreeRecord one{box, 1.0, 1, 0, 1, true};
    const LeafCounts counts = leaf_counts(std::span(&one, 1));
    CHECK(counts.mean == 1.0);
    CHECK(counts.deviation == 0.0);
    CHECK(counts.lines == 4096);
    const std::vector<TreeRecord> same{
        {box, 1.0, 3, 0, 2, false}, {box, 1.0, 2, 0, 1, true}, {box, 1.0, 3, 1, 2, true}};
    CHECK(leaf_counts(same).mean == 2.0);
    CHECK(leaf_counts(same).deviation == 0.0);
  }
  SECTION("a cube halved: the chance to meet a half is 4/6, both are met by one line in three") {
    const std::vector<TreeRecord> halves{{{{0, 0, 0}, {2, 2, 2}}, 1.0, 3, 0, 2, false},
                                         {{{0, 0, 0}, {1, 2, 2}}, 1.0, 2, 0, 1, true},
                                         {{{1, 0, 0}, {2, 2, 2}}, 1.0, 3, 1, 2, true}};
    const LeafCounts counts = leaf_counts(halves);
    CHECK(counts.mean == Approx(4.0 / 3.0).margin(0.03));                // 2 * 16 / 24
    CHECK(counts.deviation == Approx(std::sqrt(2.0) / 3).margin(0.02));  // of 1 or 2 with chances 2/3 and 1/3
  }
  SECTION("a box without thickness and one without area") {
    const std::vector<TreeRecord> flat{{{{0, 0, 5}, {2, 2, 5}}, 1.0, 3, 0, 2, false},
                                       {{{0, 0, 5}, {1, 2, 5}}, 1.0, 2, 0, 1, true},
                                       {{{1, 0, 5}, {2, 2, 5}}, 1.0, 3, 1, 2, true}};
    CHECK(leaf_counts(flat).mean == Approx(1.0).margin(0.01));
    const TreeRecord point{{{1, 1, 1}, {1, 1, 1}}, 1.0, 1, 0, 1, true};
    CHECK(leaf_counts(std::span(&point, 1)).mean == 1.0);
    CHECK(leaf_counts(std::span(&point, 1)).lines == 0);
  }
  SECTION("of a random tree, and within a bound of work") {
    const TriangleMesh mesh = random_mesh(400, 0.2f);
    std::vector<std::uint32_t> ids(mesh.size()), references;
    std::iota(ids.begin(), ids.end(), 0u);
    std::vector<TreeRecord> records;
    write_records(mesh, halved(mesh, ids), records, references);
    double expected = 0.0;
    for (const TreeRecord& r : records) expected += r.is_leaf ? r.bounds.area() / records[0].bounds.area() : 0.0;
    const LeafCounts counts = leaf_counts(records);
    CHECK(counts.mean == Approx(expected).epsilon(0.05));
    CHECK(counts.deviation > 1.0);
    CHECK(leaf_counts(records, 1.0).lines == 128);
  }
}

TEST_CASE("how full leaves are, as a histogram") {
  const TriangleMesh mesh = two_that_overlap();
  const HandMade both(mesh, {{leaf({0, 1}), leaf({1})}, {}});
  const StructureStatistics s = compute_statistics(both, mesh, {}, true);
  CHECK(s.leaf_histogram == std::vector<std::size_t>{0, 1, 1});
  CHECK(s.depth_histogram == std::vector<std::size_t>{0, 2});
  // The first leaf has the root's box, 3 by 2, the second a box of 2 by 2: their areas over the root's.
  CHECK(s.leaves_per_line == Approx(1.0 + 8.0 / 12.0).epsilon(0.02));
  const HandMade full(mesh, leaf(std::vector<std::uint32_t>(500, 0)));
  CHECK(compute_statistics(full, mesh, {}, false).leaf_histogram.back() == 1);
  CHECK(compute_statistics(full, mesh, {}, false).leaf_histogram.size() == 33);
  CHECK(compute_statistics(full, mesh, {}, false).lcv_lines == 0);
}

TEST_CASE("every structure: nodes and leaves take no more bytes than the whole, which the build's peak holds") {
  std::size_t seen = 0;
  for (const StructureEntry& entry : all_structures()) {
    if (entry.info.name == "embree") continue;  // shows nothing
    for (std::string_view builder : entry.info.builders) {
      // Handed on; the default structure below has not all
      if (entry.info.takes_below && builder != "binned_sah") continue;
      for (std::string_view leaf : entry.info.leaves) {
        for (const int triangles : {0, 1, 2, 3, 5, 8, 13, 60, 61, 62, 63, 64, 200}) {
          TriangleMesh mesh;
          Dice dice(unsigned(triangles) + 1);
          for (int i = 0; i < triangles; ++i) {
            const Vec3f at = dice.point();
            add_triangle(mesh, at, at + dice.point() * 0.1f, at + dice.point() * 0.1f);
          }
          BuildSettings settings;
          settings.builder = builder, settings.leaf = leaf, settings.isa = best_isa(), settings.threads = 1;
          BuildReport report;
          const auto accel = build_structure(entry.info.name, mesh, settings, report);
          INFO(entry.info.name << " " << builder << " " << leaf << " of " << triangles << " triangles");
          CHECK(report.peak_bytes >= accel->bytes());
          const StructureStatistics s = compute_statistics(*accel, mesh, {}, false);
          if (!s.available) continue;
          CAPTURE(s.node_bytes, s.leaf_bytes);
          CHECK(s.node_bytes + s.leaf_bytes <= s.bytes);
          ++seen;
        }
      }
    }
  }
  CHECK(seen > 1000);
}
