#include "oracle/search_tree.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <atomic>

namespace arboretum {
namespace {

constexpr int kBins = 16;
constexpr std::uint32_t kParallelRange = 8192;
constexpr double kNodeCost = 0.5;  // of a pair of box tests, in units of one triangle test

/// Centre of a box in doubles, where no float32 box overflows.
double center(const Bounds3f& b, std::size_t axis) { return 0.5 * (double(b.lower[axis]) + double(b.upper[axis])); }

/// Holds the triangle at every time, rounded as core/motion.h rounds: between two frames a coordinate leaves the
/// interval of the two by no more than four roundings of numbers of their size (weights summing to 1 + 2^-24, two
/// products, a sum).
Bounds3f bounds_at_all_times(const TriangleMesh& mesh, std::size_t i) {
  Bounds3f box = mesh.bounds(i);
  if (!mesh.moves()) return box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float size = std::max(std::fabs(box.lower[axis]), std::fabs(box.upper[axis]));
    const float pad = size * 0x1p-21f + std::numeric_limits<float>::min();
    box.lower[axis] -= pad, box.upper[axis] += pad;
  }
  return box;
}

bool is_finite_at_all_times(const TriangleMesh& mesh, std::size_t i) {
  const Triangle& t = mesh.triangles[i];
  for (std::size_t k = 0; k < mesh.frames(); ++k) {
    const std::vector<Vec3f>& frame = mesh.frame(k);
    if (!is_finite(frame[t.a]) || !is_finite(frame[t.b]) || !is_finite(frame[t.c])) return false;
  }
  return true;
}

struct Bins {
  Bounds3f bounds[kBins];
  std::uint32_t count[kBins] = {};
};

int bin_of(double c, double low, double scale) { return std::clamp(static_cast<int>((c - low) * scale), 0, kBins - 1); }

}  // namespace

struct SearchTree::BuildState {
  std::vector<Bounds3f> bounds;      // of each triangle of the mesh that is in the tree
  std::vector<std::uint32_t> order;  // triangles, permuted as the tree grows
  std::atomic<std::uint32_t> nodes{1};
};

SearchTree::SearchTree(const TriangleMesh& mesh) {
  BuildState state;
  state.bounds.resize(mesh.size());
  tbb::parallel_for(std::size_t{0}, mesh.size(),
                    [&](std::size_t i) { state.bounds[i] = bounds_at_all_times(mesh, i); });
  state.order.reserve(mesh.size());
  BuildRange all{0, 0, {}};
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    if (!is_finite_at_all_times(mesh, i)) continue;
    state.order.push_back(static_cast<std::uint32_t>(i));
    all.bounds.extend(state.bounds[i]);
  }
  if (state.order.empty()) return;
  all.end = static_cast<std::uint32_t>(state.order.size());
  nodes_ = std::make_unique_for_overwrite<Node[]>(state.order.size() + 1);

  // The root is a node whose second child does not exist unless it can be split.
  if (all.end <= kMaxLeaf) {
    Node& root = nodes_[0];
    build_child(state, all, 0, 0, 0);
    for (auto& axis : root.bounds) axis[0][1] = Bounds3f::kInfinity, axis[1][1] = -Bounds3f::kInfinity;
    root.first[1] = root.count[1] = 0;
  } else {
    const std::uint32_t middle = split(state, all, 0);
    for (int child = 0; child < 2; ++child) {
      BuildRange range{child == 0 ? 0 : middle, child == 0 ? middle : all.end, {}};
      for (std::uint32_t i = range.begin; i < range.end; ++i) range.bounds.extend(state.bounds[state.order[i]]);
      build_child(state, range, 1, 0, child);
    }
  }
  leaves_.resize(state.order.size());
  tbb::parallel_for(std::size_t{0}, leaves_.size(), [&](std::size_t i) {
    leaves_[i] = {mesh.corners(state.order[i]), state.order[i]};
  });
}

void SearchTree::build_child(BuildState& state, const BuildRange& range, unsigned depth, std::uint32_t node,
                             int child) {
  Node& parent = nodes_[node];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    parent.bounds[axis][0][child] = range.bounds.lower[axis];
    parent.bounds[axis][1][child] = range.bounds.upper[axis];
  }
  const std::uint32_t count = range.end - range.begin;
  const std::uint32_t middle = count <= 1 ? range.begin : split(state, range, depth);
  if (middle == range.begin) {
    parent.first[child] = range.begin, parent.count[child] = count;
    return;
  }
  const std::uint32_t index = state.nodes.fetch_add(1);
  parent.first[child] = index, parent.count[child] = 0;
  BuildRange left{range.begin, middle, {}}, right{middle, range.end, {}};
  for (std::uint32_t i = left.begin; i < left.end; ++i) left.bounds.extend(state.bounds[state.order[i]]);
  for (std::uint32_t i = right.begin; i < right.end; ++i) right.bounds.extend(state.bounds[state.order[i]]);
  if (count > kParallelRange) {
    tbb::parallel_invoke([&] { build_child(state, left, depth + 1, index, 0); },
                         [&] { build_child(state, right, depth + 1, index, 1); });
  } else {
    build_child(state, left, depth + 1, index, 0);
    build_child(state, right, depth + 1, index, 1);
  }
}

/// Where the range is cut after its part of `order` is rearranged, or its begin when it is to be a leaf.
std::uint32_t SearchTree::split(BuildState& state, const BuildRange& range, unsigned depth) const {
  const std::uint32_t count = range.end - range.begin, half = range.begin + count / 2;
  if (depth >= kHeuristicDepth) return count <= kMaxLeaf ? range.begin : half;
  const auto first = state.order.begin() + range.begin, last = state.order.begin() + range.end;

  double low[3], high[3];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    low[axis] = std::numeric_limits<double>::infinity(), high[axis] = -low[axis];
    for (auto i = first; i != last; ++i) {
      const double c = center(state.bounds[*i], axis);
      low[axis] = std::min(low[axis], c), high[axis] = std::max(high[axis], c);
    }
  }
  double best_cost = std::numeric_limits<double>::infinity();
  std::size_t best_axis = 0;
  int best_bin = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!(high[axis] > low[axis])) continue;
    const double scale = kBins / (high[axis] - low[axis]);
    if (!(scale < std::numeric_limits<double>::infinity())) continue;
    Bins bins;
    for (auto i = first; i != last; ++i) {
      const int b = bin_of(center(state.bounds[*i], axis), low[axis], scale);
      bins.bounds[b].extend(state.bounds[*i]);
      ++bins.count[b];
    }
    double right_cost[kBins] = {};
    Bounds3f box;
    std::uint32_t n = 0;
    for (int b = kBins - 1; b > 0; --b) {
      box.extend(bins.bounds[b]), n += bins.count[b];
      right_cost[b] = n == 0 ? std::numeric_limits<double>::infinity() : box.area() * n;
    }
    box = {}, n = 0;
    for (int b = 0; b + 1 < kBins; ++b) {
      box.extend(bins.bounds[b]), n += bins.count[b];
      if (n == 0) continue;
      const double cost = box.area() * n + right_cost[b + 1];
      if (cost < best_cost) best_cost = cost, best_axis = axis, best_bin = b;
    }
  }
  if (count <= kMaxLeaf && !(best_cost + kNodeCost * range.bounds.area() < range.bounds.area() * count))
    return range.begin;
  if (!(best_cost < std::numeric_limits<double>::infinity())) return half;
  const double scale = kBins / (high[best_axis] - low[best_axis]);
  const auto middle = std::partition(first, last, [&](std::uint32_t i) {
    return bin_of(center(state.bounds[i], best_axis), low[best_axis], scale) <= best_bin;
  });
  return static_cast<std::uint32_t>(middle - state.order.begin());
}

}  // namespace arboretum
