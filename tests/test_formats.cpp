// Node formats beside the plain one: quantised boxes hold what they stand for, exactly; nodes take the bytes they
// claim; deep trees have the stack they need.
#include <algorithm>
#include <bit>
#include <boost/multiprecision/cpp_int.hpp>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "oracle/oracle.h"
#include "structures/accel.h"
#include "structures/bvh4_aos/bvh4_aos.h"
#include "structures/bvh_quantised/bvh_quantised.h"
#include "structures/statistics.h"
#include "tests/catch.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"

using namespace arboretum;
using namespace arboretum::test;
using bvh_quantised::QuantisedNodes;
using Rational = boost::multiprecision::cpp_rational;

namespace {

const char* const kFormats[] = {"bvh4_aos", "bvh4_quantised", "bvh8_quantised"};

Rational exact_plane(const bvh_quantised::Grid& grid, unsigned q) {
  return Rational(grid.origin) + Rational(q) * Rational(std::ldexp(1.0, grid.exponent - 127));
}

template <int N>
void check_node(const std::vector<Bounds3f>& boxes) {
  std::vector<bvh::NodeReference> references(boxes.size());
  for (std::size_t i = 0; i < boxes.size(); ++i) references[i] = bvh::NodeReference(32 * (i + 7));
  typename QuantisedNodes<N>::Node node;
  QuantisedNodes<N>::write(node, boxes.data(), references.data(), unsigned(boxes.size()));
  Bounds3f seen[16];
  bvh::NodeReference seen_references[16];
  REQUIRE(QuantisedNodes<N>::read(node, seen, seen_references) == boxes.size());
  CHECK(node.children == (1u << boxes.size()) - 1);
  for (std::size_t i = 0; i < boxes.size(); ++i) {
    CHECK(seen_references[i] == references[i]);
    CHECK(seen[i].contains(boxes[i]));
    for (int axis = 0; axis < 3; ++axis) {
      const bvh_quantised::Grid grid = grid_of(node, axis);
      CAPTURE(i, axis, boxes[i].lower[axis], boxes[i].upper[axis], int(grid.exponent), grid.origin);
      const unsigned low = node.plane(unsigned(axis), 0, unsigned(i)),
                     high = node.plane(unsigned(axis), 1, unsigned(i));
      REQUIRE((grid.exponent >= 21 && grid.exponent <= 254));
      const Rational lower = boxes[i].lower[axis], upper = boxes[i].upper[axis];
      CHECK(exact_plane(grid, low) <= lower);
      CHECK(exact_plane(grid, high) >= upper);
      // No plane nearer would do: the box is the tightest on its grid.
      const bool finite = std::ldexp(low + 1.0, grid.exponent - 127) <= std::numeric_limits<float>::max();
      if (low < 1023 && finite) CHECK(exact_plane(grid, low + 1) > lower);
      if (high > 0) CHECK(exact_plane(grid, high - 1) < upper);
    }
  }
}

Bounds3f box_between(Vec3f a, Vec3f b) { return {min(a, b), max(a, b)}; }

}  // namespace

TEST_CASE("quantised boxes hold random boxes at every scale and offset, exactly and tightly") {
  for (std::uint64_t i = 0; i < 3000; ++i) {
    const float scale = std::ldexp(1.0f, int(random_bits(1, i, 0) % 200) - 120);
    const float offset = i % 3 == 0 ? 0.0f : i % 3 == 1 ? 1e6f : uniform(1, i, 1, -1e3f, 1e3f) * scale;
    const auto point = [&](std::uint64_t k) {
      return Vec3f{offset + scale * uniform(2, i, 3 * k, -1, 1), offset + scale * uniform(2, i, 3 * k + 1, -1, 1),
                   offset - scale * uniform(2, i, 3 * k + 2, -1, 1)};
    };
    std::vector<Bounds3f> boxes;
    for (std::uint64_t k = 0; k < 1 + i % 8; ++k) boxes.push_back(box_between(point(2 * k), point(2 * k + 1)));
    INFO("case " << i << " scale " << scale << " offset " << offset);
    check_node<8>(boxes);
    boxes.resize(std::min<std::size_t>(boxes.size(), 4));
    check_node<4>(boxes);
  }
}

TEST_CASE("quantised boxes hold extreme boxes: flat, points, huge, tiny, subnormal, an ulp thick") {
  constexpr float kMax = std::numeric_limits<float>::max(), kLeast = std::numeric_limits<float>::denorm_min();
  const auto up = [](float x) { return std::nextafter(x, kInfinity); };
  const float values[] = {-kMax,
                          -1e30f,
                          -1e6f,
                          -up(1.0f),
                          -1.0f,
                          -0x1p-126f,
                          -kLeast,
                          -0.0f,
                          0.0f,
                          kLeast,
                          3 * kLeast,
                          0x1p-149f * 1023,
                          0x1p-149f * 1024,
                          1e-38f,
                          0.1f,
                          0x1.ff8p0f,
                          1.0f,
                          up(1.0f),
                          1022.0f,
                          1023.0f,
                          up(1023.0f),
                          1e6f,
                          up(1e6f),
                          kMax};
  std::vector<std::pair<float, float>> ranges;
  for (float a : values)
    for (float b : values)
      if (a <= b) ranges.emplace_back(a, b);
  for (std::size_t i = 0; i < ranges.size(); ++i) {
    const auto [x0, x1] = ranges[i];
    const auto [y0, y1] = ranges[(7 * i + 3) % ranges.size()];
    const auto [z0, z1] = ranges[(13 * i + 5) % ranges.size()];
    const Bounds3f box{{x0, y0, z0}, {x1, y1, z1}};
    INFO("x " << x0 << " .. " << x1 << ", y " << y0 << " .. " << y1 << ", z " << z0 << " .. " << z1);
    check_node<8>({box});
    check_node<8>({box, {{x0, y0, z0}, {x0, y1, z0}}, {{x1, y0, z1}, {x1, y1, z1}}});
  }
  // A grid of whole steps is kept without loss, and a flat one is flat.
  std::vector<Bounds3f> cells;
  for (int i = 0; i < 8; ++i)
    cells.push_back({{float(i) * 128.0f, 5.0f, -3.0f}, {float(i) * 128.0f + 127.0f, 5.0f, 1020.0f}});
  typename QuantisedNodes<8>::Node node;
  const bvh::NodeReference references[8] = {};
  QuantisedNodes<8>::write(node, cells.data(), references, 8);
  Bounds3f seen[8];
  bvh::NodeReference seen_references[8];
  REQUIRE(QuantisedNodes<8>::read(node, seen, seen_references) == 8);
  for (int i = 0; i < 8; ++i) CHECK(seen[i] == cells[std::size_t(i)]);
}

TEST_CASE("a node of bvh4_aos is two lines: four minima with their references, four maxima") {
  const std::vector<Bounds3f> boxes{{{1, 2, 3}, {4, 5, 6}}, {{-1, -2, -3}, {0, 0, 0}}, {{7, 7, 7}, {7, 7, 7}}};
  const bvh::NodeReference references[3] = {64, 128 | bvh::kLeafBit, 192};
  bvh4_aos::Node node;
  bvh4_aos::AosNodes::write(node, boxes.data(), references, 3);
  const auto word = [&](std::size_t i) { return reinterpret_cast<const std::uint32_t*>(&node)[i]; };
  for (std::size_t i = 0; i < 4; ++i) {
    CHECK(word(4 * i + 3) == (i < 3 ? references[i] : 0));
    CHECK(word(16 + 4 * i + 3) == 0);
    if (i < 3) CHECK(std::bit_cast<float>(word(4 * i + 1)) == boxes[i].lower.y);
    if (i < 3) CHECK(std::bit_cast<float>(word(16 + 4 * i + 2)) == boxes[i].upper.z);
  }
  Bounds3f seen[4];
  bvh::NodeReference seen_references[4];
  REQUIRE(bvh4_aos::AosNodes::read(node, seen, seen_references) == 3);
  for (std::size_t i = 0; i < 3; ++i) CHECK((seen[i] == boxes[i] && seen_references[i] == references[i]));
}

TEST_CASE("node bytes: at least 35 % less when quantised, for the same tree") {
  const TriangleMesh mesh = random_triangles(20000, 0.03f, 1);
  const auto statistics = [&](const char* structure) {
    BuildSettings settings;
    BuildReport report;
    const auto accel = build_structure(structure, mesh, settings, report);
    CHECK(report.peak_bytes >= accel->bytes());
    const StructureStatistics s = compute_statistics(*accel, mesh, {}, false);
    CHECK(s.node_bytes + s.leaf_bytes == s.bytes);
    return s;
  };
  const auto bvh4 = statistics("bvh4"), bvh8 = statistics("bvh8"), aos = statistics("bvh4_aos");
  const auto small4 = statistics("bvh4_quantised"), small8 = statistics("bvh8_quantised");
  CHECK(small8.nodes == bvh8.nodes);
  CHECK(small4.nodes == bvh4.nodes);
  CHECK(small8.node_bytes == 128 * small8.nodes);
  CHECK(small4.node_bytes == 64 * small4.nodes);
  CHECK(aos.node_bytes == 128 * aos.nodes);
  CHECK(double(small8.node_bytes) <= 0.65 * double(bvh8.node_bytes));
  CHECK(double(small4.node_bytes) <= 0.65 * double(bvh4.node_bytes));
  CHECK(aos.sah_cost == Approx(bvh4.sah_cost));
  CHECK(small8.sah_cost >= bvh8.sah_cost);
  CHECK(small8.sah_cost <= 1.1 * bvh8.sah_cost);  // boxes grow by a step at most
}

TEST_CASE("every triangle stands once in a leaf whose boxes, as rays meet them, hold it") {
  for (const char* structure : kFormats) {
    for (const TriangleMesh& mesh : {random_triangles(3001, 0.05f, 3), flat_grid(16),
                                     moved(random_triangles(500, 0.1f, 4), 1.0f, {1e6f, 1e6f, -1e6f})}) {
      struct Seen final : StructureVisitor {
        const TriangleMesh& mesh;
        std::vector<unsigned> times;
        bool held = true;
        explicit Seen(const TriangleMesh& m) : mesh(m), times(m.size(), 0) {}
        void node(const NodeView&) override {}
        void leaf(const LeafView& l) override {
          for (std::uint32_t p : l.primitives) ++times.at(p), held &= l.bounds.contains(mesh.bounds(p));
        }
      } seen(mesh);
      BuildReport report;
      REQUIRE(build_structure(structure, mesh, {}, report)->visit(seen));
      INFO(structure);
      CHECK(std::ranges::all_of(seen.times, [](unsigned n) { return n == 1; }));
      CHECK(seen.held);
    }
  }
}

TEST_CASE("a tree deeper than the stack on the frame, one triangle a leaf") {
  TriangleMesh mesh;  // each triangle a quarter of the one before: four children a node at most, long chains
  for (int i = 0; i < 120; ++i) {
    const float s = std::ldexp(1.0f, 50 - i);
    const auto first = std::uint32_t(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), {{s, s, 0}, {2 * s, s, 0.1f * s}, {s, 2 * s, 0.2f * s}});
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const auto c = mesh.corners(std::uint32_t(i));
    const Vec3f at = c[0] * 0.3f + c[1] * 0.3f + c[2] * 0.4f;
    rays.push_back({at + Vec3f{0, 0, 1} * c[0].x, 0, Vec3f{0, 0, -1} * c[0].x, kInfinity});
  }
  const Oracle oracle(mesh);
  const auto truth = oracle.closest_hit(rays);
  Structures structures(mesh);
  for (const KernelRow& row : runnable_rows()) {
    if (std::ranges::find(kFormats, row.structure) == std::end(kFormats) || row.intersector != "watertight" ||
        row.box != "padded")
      continue;
    INFO(name_of(row));
    CHECK(oracle.check_closest_hit(rays, truth, closest_hit(row, structures.get(row), rays)).wrong_answers() == 0);
  }
}

TEST_CASE(
    "a large scene and a short direction: the node's origin in the ray's parameter overflows, the distance does not") {
  TriangleMesh mesh = moved(random_triangles(400, 0.1f, 5), 0x1p40f);
  const float a = 0x1p38f;
  for (int i = 0; i < 30; ++i) {
    const float z = 0x1p34f * float(i - 15);
    const auto first = std::uint32_t(mesh.vertices.size());
    mesh.vertices.insert(mesh.vertices.end(), {{-a, -a, z}, {a, -a, z}, {0, a, z}});
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  std::vector<Ray> rays;
  for (float length : {0x1p-40f, 0x1p-30f, 0x1p-50f, 1.0f}) {
    for (float off : {0.0f, 1.0f, -3.0f, 0x1p10f}) {
      rays.push_back({{off, 1, -0x1p40f}, 0, {0, 0, length}, kInfinity}),
          rays.push_back({{off, -off, 0x1p40f}, 0, {-0.0f, 0, -length}, kInfinity});
      rays.push_back({{off, off, 1}, 0, {0, 0, length}, kInfinity}),
          rays.push_back({{1, off, 0}, 0, {0x1p-62f * length, 0, length}, kInfinity});
    }
  }
  Structures structures(mesh);
  std::size_t hits = 0;
  for (const KernelRow& row : runnable_rows()) {
    if (!row.structure.ends_with("_quantised") || row.box != "padded") continue;
    const KernelRow* reference = find_kernel("brute_force", row.leaf, row.intersector, row.box, "single", row.isa);
    if (!reference) continue;
    INFO(name_of(row));
    const std::vector<Hit> want = closest_hit(*reference, structures.get(*reference), rays),
                           got = closest_hit(row, structures.get(row), rays);
    CHECK(same_bits(got, want));
    hits += std::size_t(std::ranges::count_if(want, &Hit::is_hit));
  }
  CHECK(hits > 0);
}

TEST_CASE("rays along an axis visit a path of a flat grid, not every node") {
  const TriangleMesh mesh = flat_grid(128);
  Structures structures(mesh);
  const std::vector<Ray> rays{{{0, 0, 3}, 0, {0, 0, -1}, kInfinity}, {{0.5f, 0.25f, 3}, 0, {0, -0.0f, -1}, kInfinity}};
  for (const KernelRow& row : runnable_rows()) {
    if (std::ranges::find(kFormats, row.structure) == std::end(kFormats)) continue;
    Counters counters;
    (void)closest_hit(row, structures.get(row), rays, &counters);
    INFO(name_of(row));
    CHECK(counters.nodes < 400);
  }
}
