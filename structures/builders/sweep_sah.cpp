// Full-sweep SAH builder: every split between neighbours in the order of centroids is tried, on all three axes
// (MacDonald and Booth 1990; Wald, Boulos, Shirley, "Ray Tracing Deformable Scenes using Dynamic Bounding Volume
// Hierarchies", TOG 2007, section 3.2). The triangles are sorted once on each axis and a partition keeps the three
// orders, so that building takes O(n log n).
//
// Equal centroids are ordered by triangle, so the tree does not depend on threads. Cost is that of binned_sah: area
// times references on both sides, in blocks of the leaf's width and one block at least.
#include <algorithm>
#include <array>
#include <atomic>
#include <limits>

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/parallel_sort.h>

#include "structures/builders/portable_builders.h"
#include "structures/builders/one_task.h"
#include "structures/builders/phase_clock.h"

namespace arboretum {
namespace {

constexpr std::size_t kChunk = 1u << 12;  ///< references that a task takes at a time

class SweepSah {
 public:
  SweepSah(const TriangleMesh& mesh, unsigned leaf_width, BinaryTree& tree)
      : mesh_(mesh), leaf_width_(leaf_width), tree_(tree) {}

  void build(BuildReport& report) {
    const std::size_t n = mesh_.size();
    PhaseClock phase(report);
    boxes_.resize(n), is_left_.resize(n), scratch_.resize(2 * n), right_cost_.resize(3 * n);
    tbb::parallel_for(std::size_t{0}, (n + kChunk - 1) / kChunk, [&](std::size_t chunk) {
      for (std::size_t i = chunk * kChunk; i < std::min(n, (chunk + 1) * kChunk); ++i) boxes_[i] = mesh_.bounds(i);
    });
    phase.ends("references");
    sort();
    phase.ends("sort");
    tree_.nodes.reserve(2 * n + 1), tree_.first.reserve(2 * n + 1), hand_out(1);
    Bounds3f all;
    for (const Bounds3f& b : boxes_) all.extend(b);
    split(0, 0, n, all);
    tree_.node_count = next_.load();
    for (int axis : {1, 2}) MeteredVector<std::uint32_t>().swap(order_[axis]);  // an assignment would keep the memory
    tree_.primitives = std::move(order_[0]);
    phase.ends("splits");
  }

 private:
  struct Split {
    float cost = std::numeric_limits<float>::infinity();
    int axis = 0;
    std::size_t left = 0;  ///< references on the left; 0: no split found
  };

  void hand_out(std::size_t n) { tree_.nodes.hand_out(n), tree_.first.hand_out(n); }

  void sort() {
    const std::size_t n = mesh_.size();
    struct Key {
      float centroid;  // doubled
      std::uint32_t id;
      bool operator<(const Key& o) const noexcept { return centroid != o.centroid ? centroid < o.centroid : id < o.id; }
    };
    MeteredVector<Key> keys(n);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (std::size_t i = 0; i < n; ++i)
        keys[i] = {boxes_[i].lower[int(axis)] + boxes_[i].upper[int(axis)], std::uint32_t(i)};
      tbb::parallel_sort(keys.begin(), keys.end());
      order_[axis].resize(n);
      for (std::size_t i = 0; i < n; ++i) order_[axis][i] = keys[i].id;
    }
  }

  [[nodiscard]] float cost(const Bounds3f& box, std::size_t count) const noexcept {
    return half_area(box.lower, box.upper) * float((std::uint32_t(count) + leaf_width_ - 1) / leaf_width_);
  }

  [[nodiscard]] Split sweep(int axis, std::size_t begin, std::size_t end) {
    const MeteredVector<std::uint32_t>& order = order_[std::size_t(axis)];
    float* right_cost = right_cost_.data() + std::size_t(axis) * mesh_.size();
    Bounds3f box;
    for (std::size_t i = end; i-- > begin + 1;) {
      box.extend(boxes_[order[i]]);
      right_cost[i] = cost(box, end - i);
    }
    Split best;
    best.axis = axis, box = {};
    for (std::size_t i = begin; i + 1 < end; ++i) {
      box.extend(boxes_[order[i]]);
      const float total = cost(box, i + 1 - begin) + right_cost[i + 1];
      // Among equal ones the split nearest the middle, or a line of points would make a list.
      if (total < best.cost || (total == best.cost && 2 * (i + 1 - begin) <= end - begin))
        best.cost = total, best.left = i + 1 - begin;
    }
    return best;
  }

  [[nodiscard]] bool centroids_coincide(std::size_t begin, std::size_t end) const {
    for (int axis = 0; axis < 3; ++axis) {
      const Bounds3f &low = boxes_[order_[std::size_t(axis)][begin]],
                     &high = boxes_[order_[std::size_t(axis)][end - 1]];
      if (low.lower[axis] + low.upper[axis] != high.lower[axis] + high.upper[axis]) return false;
    }
    return true;
  }

  void partition(int axis, std::size_t begin, std::size_t end, std::uint32_t* scratch) {
    std::uint32_t* order = order_[std::size_t(axis)].data();
    std::size_t left = begin, right = 0;
    for (std::size_t i = begin; i < end; ++i) {
      const std::uint32_t id = order[i];
      order[left] = id, scratch[right] = id;  // one of the two stays
      left += is_left_[id], right += !is_left_[id];
    }
    std::copy(scratch, scratch + right, order + left);
  }

  void split(std::uint32_t index, std::size_t begin, std::size_t end, const Bounds3f& bounds) {
    const std::size_t n = end - begin;
    BinaryNode& node = tree_.nodes[index];
    node = {bounds.lower, 0, bounds.upper, std::uint32_t(n)};
    if (n <= leaf_width_) {
      tree_.first[index] = std::uint32_t(begin);
      return;  // all three orders hold the same references there
    }
    const bool parallel = n > kOneTask;
    std::array<Split, 3> found;
    if (parallel) {
      tbb::parallel_for(0, 3, [&](int axis) { found[std::size_t(axis)] = sweep(axis, begin, end); });
    } else {
      for (int axis = 0; axis < 3; ++axis) found[std::size_t(axis)] = sweep(axis, begin, end);
    }
    Split best = found[0];
    for (const Split& s : found) {
      if (s.cost < best.cost) best = s;
    }
    if (best.left == 0 || centroids_coincide(begin, end)) best.left = n / 2;  // in the middle of the order
    const std::size_t middle = begin + best.left;
    const MeteredVector<std::uint32_t>& order = order_[std::size_t(best.axis)];
    Bounds3f left, right;
    for (std::size_t i = begin; i < end; ++i) {
      is_left_[order[i]] = i < middle;
      (i < middle ? left : right).extend(boxes_[order[i]]);
    }
    const int other[2] = {(best.axis + 1) % 3, (best.axis + 2) % 3};
    if (parallel) {
      std::uint32_t* second = scratch_.data() + mesh_.size();
      tbb::parallel_invoke([&] { partition(other[0], begin, end, scratch_.data() + begin); },
                           [&] { partition(other[1], begin, end, second + begin); });
    } else {
      for (int axis : other) partition(axis, begin, end, scratch_.data() + begin);
    }
    const std::uint32_t first = next_.fetch_add(2, std::memory_order_relaxed);
    hand_out(2);
    node.left = first;
    if (parallel) {
      tbb::parallel_invoke([&] { split(first, begin, middle, left); }, [&] { split(first + 1, middle, end, right); });
    } else {
      split(first, begin, middle, left);
      split(first + 1, middle, end, right);
    }
  }

  const TriangleMesh& mesh_;
  const unsigned leaf_width_;
  BinaryTree& tree_;
  MeteredVector<Bounds3f> boxes_;
  MeteredVector<std::uint32_t> order_[3];  ///< of each axis: triangles by centroid, within each node's [begin, end)
  MeteredVector<std::uint8_t> is_left_;
  MeteredVector<std::uint32_t> scratch_;
  MeteredVector<float> right_cost_;  ///< for each axis: the cost of all from here to the node's end
  std::atomic<std::uint32_t> next_{1};
};

}  // namespace

void build_sweep_sah(const TriangleMesh& mesh, const BuilderParameters&, unsigned leaf_width, BinaryTree& tree,
                     BuildReport& report) {
  SweepSah(mesh, leaf_width, tree).build(report);
}

}  // namespace arboretum
