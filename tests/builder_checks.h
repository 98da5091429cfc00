// What tests of builders share: a tree by a builder's name, and what every binary tree must be.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string_view>
#include <vector>

#include <tbb/task_arena.h>

#include "core/random.h"
#include "structures/builders/builder_parameters.h"
#include "structures/builders/builders.h"
#include "structures/statistics.h"
#include "tests/catch.h"
#include "tests/kernel_scenes.h"

namespace arboretum::test {

inline constexpr std::string_view kReinsertion = "_reinsertion";

/// Builders that may refer to a triangle more than once, from boxes that hold parts of it.
inline bool splits_triangles(std::string_view builder) {
  const std::vector<std::string_view> reads = binary_builder_parameters(builder);
  return std::ranges::find(reads, "duplication_budget") != reads.end();
}

inline BinaryTree build(std::string_view builder, const TriangleMesh& mesh, unsigned leaf_width, unsigned threads = 1,
                        Isa isa = best_isa(), const BuilderParameters& parameters = {}) {
  BuildSettings settings;
  settings.builder = builder, settings.isa = isa, settings.threads = threads, settings.parameters = parameters;
  BinaryTree tree;
  BuildReport report;
  tbb::task_arena(int(threads), 1).execute([&] { build_binary_tree(mesh, settings, leaf_width, tree, report); });
  if (mesh.size() > 0) CHECK(!report.phases.empty());
  return tree;
}

inline Bounds3f box_of(const BinaryNode& node) { return {node.lower, node.upper}; }

/// Whether every part of the triangle that we look at is in one of the boxes.
inline bool covers(const std::vector<Bounds3f>& boxes, const std::array<Vec3f, 3>& corner) {
  constexpr int kSteps = 8;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; i + j <= kSteps; ++j) {
      const float u = float(i) / kSteps, v = float(j) / kSteps;
      const Vec3f p = corner[0] * (1 - u - v) + corner[1] * u + corner[2] * v;  // rounded: allow for that
      const float slack = 1e-5f * std::max({std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)});
      const Vec3f s{slack, slack, slack};
      const bool inside = std::ranges::any_of(boxes, [&](const Bounds3f& b) {
        return Bounds3f{b.lower - s, b.upper + s}.contains({p, p});
      });
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
inline Facts check_tree(const BinaryTree& tree, const TriangleMesh& mesh, unsigned leaf_width, bool splits) {
  Facts facts;
  if (mesh.size() == 0) {
    CHECK(tree.primitives.empty());
    CHECK(tree.node_count == 0);
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
    for (int axis = 0; axis < 3; ++axis)
      put(std::bit_cast<std::uint32_t>(node.lower[axis])), put(std::bit_cast<std::uint32_t>(node.upper[axis]));
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
inline TriangleMesh copies(const std::vector<Vec3f>& centres, const std::vector<float>& sizes) {
  TriangleMesh mesh;
  for (std::size_t i = 0; i < centres.size(); ++i) {
    const auto first = std::uint32_t(mesh.vertices.size());
    const float h = 0.5f * sizes[i];
    for (const Vec3f corner : {Vec3f{-h, -h, 0}, Vec3f{h, -h, 0}, Vec3f{-h, h, 0}})
      mesh.vertices.push_back(centres[i] + corner);
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

/// Triangles about one point, each `ratio` times the size of the one before.
inline TriangleMesh nested(std::size_t count, double ratio) {
  TriangleMesh mesh;
  for (std::size_t i = 0; i < count; ++i) {
    const auto first = std::uint32_t(mesh.vertices.size());
    const auto size = float(std::pow(ratio, double(i)));
    for (const Vec3f corner : {Vec3f{-1, -1, -1}, Vec3f{1, -1, 1}, Vec3f{0, 1, 0}})
      mesh.vertices.push_back(corner * size);
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

inline std::vector<Vec3f> random_points(std::size_t n, float extent, std::uint64_t seed) {
  std::vector<Vec3f> points(n);
  for (std::size_t i = 0; i < n; ++i) points[i] = uniform_point(seed, i, 0, {{0, 0, 0}, {extent, extent, extent}});
  return points;
}

inline double sah_of(std::string_view builder, const TriangleMesh& mesh, const BuilderParameters& parameters = {},
                     std::string_view structure = "bvh2", unsigned threads = 1) {
  BuildSettings settings;
  settings.builder = builder, settings.leaf = "triangle4", settings.isa = best_isa(), settings.threads = threads,
  settings.parameters = parameters;
  BuildReport report;
  const auto accel = build_structure(structure, mesh, settings, report);
  return compute_statistics(*accel, mesh, {}, false).sah_cost;
}

}  // namespace arboretum::test
