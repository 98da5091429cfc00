// SearchTree: the oracle's own hierarchy of boxes. It shares no code with structures/, and its box test never
// turns away a box that the exact ray touches.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "core/mesh.h"
#include "core/ray.h"

namespace arboretum {

class SearchTree {
 public:
  /// Builds over the triangles whose corners are all finite, in all key frames; the others are left out. Boxes hold a
  /// triangle at every time; the corners that a search shows are those of the first frame.
  explicit SearchTree(const TriangleMesh& mesh);

  /// Calls `triangle(id, corners, limit)` for every triangle that the ray may meet at a t in [tnear, limit],
  /// roughly front to back. `limit` starts as tfar; the callee may lower it to anything that is not below the
  /// nearest hit's t. The search ends when the callee returns true. The ray begins at `origin`, of which its own is the
  /// rounding or something near.
  template <class Callee>
  void search(const Ray& ray, const std::array<double, 3>& origin, Callee&& triangle) const;

 private:
  /// Two children side by side: bounds[axis][side][child]. A child with count > 0 is a leaf of that many
  /// triangles from `first`; one with count == 0 and first == 0 does not exist (only the root's, which
  /// nothing points at, can be 0).
  struct Node {
    float bounds[3][2][2];
    std::uint32_t first[2];
    std::uint32_t count[2];
  };
  struct Leaf {
    std::array<Vec3f, 3> corners;
    std::uint32_t id;
  };
  struct BuildState;
  struct BuildRange {
    std::uint32_t begin, end;
    Bounds3f bounds;
  };

  static constexpr unsigned kMaxLeaf = 4;
  static constexpr unsigned kHeuristicDepth = 64;  ///< below it ranges are halved: 32 more levels at most
  static constexpr unsigned kStack = kHeuristicDepth + 40;

  void build_child(BuildState& state, const BuildRange& range, unsigned depth, std::uint32_t node, int child);
  std::uint32_t split(BuildState& state, const BuildRange& range, unsigned depth) const;

  std::unique_ptr<Node[]> nodes_;  // left uninitialised: only what is used is ever touched
  std::vector<Leaf> leaves_;
};

/// Box test of one ray. For an axis with d != 0 the exact ray is between the planes l and h for t in
///   [(l - o) / d, (h - o) / d]   (or the other way round).
/// Computed in doubles, (l - o) * (1 / d) has three roundings and no under- or overflow (operands on the grid of
/// float32), so it is the exact number times 1 + e with
///   |e| < 4 * 2^-53.
/// Scaling keeps the order, so the largest entry of the axes is also within that of the exact one, and widening entry
/// and exit by kWiden = 2^-50 of their size covers both and the rounding of the widening itself. An axis with d == 0
/// (either sign) is a plain comparison of exact numbers.
class ConservativeSlabs {
 public:
  ConservativeSlabs(const Ray& ray, const std::array<double, 3>& origin) noexcept : origin_(origin), tnear_(ray.tnear) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double d = ray.direction[axis];
      parallel_[axis] = d == 0.0;
      reciprocal_[axis] = parallel_[axis] ? 0.0 : 1.0 / d;
      near_side_[axis] = d < 0.0;
    }
    any_parallel_ = parallel_[0] || parallel_[1] || parallel_[2];
  }

  /// Whether child `c` of the bounds may be met at a t in [tnear, limit]; `entry` is then at most the exact t
  /// of entry.
  [[nodiscard]] bool touches(const float (&bounds)[3][2][2], int c, double limit, double& entry) const noexcept {
    constexpr double kWiden = 0x1p-50, kInfinity = std::numeric_limits<double>::infinity();
    double enter = -kInfinity, leave = kInfinity;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (any_parallel_ && parallel_[axis]) {
        if (bounds[axis][0][c] > origin_[axis] || bounds[axis][1][c] < origin_[axis]) return false;
        continue;
      }
      const double n = (bounds[axis][near_side_[axis]][c] - origin_[axis]) * reciprocal_[axis];
      const double f = (bounds[axis][1 - near_side_[axis]][c] - origin_[axis]) * reciprocal_[axis];
      enter = n > enter ? n : enter;
      leave = f < leave ? f : leave;
    }
    entry = enter - std::fabs(enter) * kWiden;
    leave += std::fabs(leave) * kWiden;
    return entry <= leave && leave >= tnear_ && entry <= limit;
  }

 private:
  std::array<double, 3> origin_, reciprocal_;
  std::array<int, 3> near_side_;
  std::array<bool, 3> parallel_;
  bool any_parallel_ = false;
  double tnear_;
};

template <class Callee>
void SearchTree::search(const Ray& ray, const std::array<double, 3>& origin, Callee&& triangle) const {
  if (leaves_.empty()) return;
  struct Entry {
    double entry;
    std::uint32_t first, count;
  };
  const ConservativeSlabs slabs(ray, origin);
  double limit = ray.tfar;
  std::array<Entry, kStack> stack;  // one waiting child a level
  std::size_t height = 0;
  Entry now{-std::numeric_limits<double>::infinity(), 0, 0};
  for (;;) {
    if (now.count > 0) {
      for (std::uint32_t k = 0; k < now.count; ++k) {
        const Leaf& leaf = leaves_[now.first + k];
        if (triangle(leaf.id, leaf.corners, limit)) return;
      }
    } else {
      const Node& node = nodes_[now.first];
      double entry[2];
      const bool left = slabs.touches(node.bounds, 0, limit, entry[0]);
      const bool right = slabs.touches(node.bounds, 1, limit, entry[1]);
      if (left && right) {
        const int near = entry[1] < entry[0];
        stack[height++] = {entry[1 - near], node.first[1 - near], node.count[1 - near]};
        now = {entry[near], node.first[near], node.count[near]};
        continue;
      }
      if (left || right) {
        const int child = right;
        now = {entry[child], node.first[child], node.count[child]};
        continue;
      }
    }
    do {
      if (height == 0) return;
      now = stack[--height];
    } while (now.entry > limit);
  }
}

}  // namespace arboretum
