// PLOC (Meister and Bittner, "Parallel Locally-Ordered Clustering for Bounding Volume Hierarchy Construction", TVCG
// 2018): clusters stand in Morton order; each round every one finds, among `ploc_radius` neighbours on either side, the
// one whose common box is smallest, and pairs that chose each other merge.
//
// Where we differ: of equal areas the least (i xor j) wins, so that a run of equal triangles pairs up as a whole and
// some pair always merges; and a round in which next to nothing merges (each cluster nearest to the one before it, as
// where gaps grow) is replaced by merging neighbours, which bounds rounds and depth.
#include <algorithm>
#include <bit>
#include <limits>
#include <utility>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "structures/builders/portable_builders.h"
#include "structures/builders/linked_tree.h"
#include "structures/builders/morton_order.h"
#include "structures/builders/phase_clock.h"

namespace arboretum {
namespace {

constexpr std::size_t kChunk = 1u << 12;
constexpr std::size_t kFew = 1024;       ///< with this many clusters any round is cheap
constexpr std::size_t kLeastShare = 64;  ///< one cluster in so many has to merge
/// Triangles that may share the first bits of their codes and stand in order of their ids
constexpr std::size_t kShortRun = 8;

class Ploc {
 public:
  Ploc(const TriangleMesh& mesh, const MortonOrder& order, unsigned radius, LinkedTree& tree)
      : radius_(radius), tree_(tree) {
    const std::size_t n = order.size();
    tree.nodes.resize(2 * n - 1), tree.primitives.resize(n);
    current_.resize(n), next_.resize(n), best_.resize(n), results_.resize((n + kChunk - 1) / kChunk);
    for_chunks([&](std::size_t, std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        const std::uint32_t id = tree.primitives[i] = order.id(i);
        const Bounds3f box = mesh.bounds(id);
        tree.nodes[i] = LinkedNode::leaf(box, std::uint32_t(i), 1);
        current_.set(i, box, std::uint32_t(i));
      }
    });
  }

  void run() {
    auto nodes = std::uint32_t(current_.size);
    while (current_.size > 1) {
      for_chunks([&](std::size_t, std::size_t begin, std::size_t end) { find_best(begin, end); });
      std::size_t merged = count_merges();
      if (current_.size > kFew && merged < current_.size / kLeastShare) {
        for (std::size_t i = 0; i < current_.size; ++i) best_[i] = 1;
        merged = count_merges();
      }
      merge(nodes);
      nodes += std::uint32_t(merged);
    }
    tree_.root = current_.node[0];
  }

 private:
  /// Boxes of the clusters in order, as structure of arrays, and their nodes.
  struct Clusters {
    MeteredVector<float> lower[3], upper[3];
    MeteredVector<std::uint32_t> node;
    std::size_t size = 0;

    void resize(std::size_t n) {
      for (int axis = 0; axis < 3; ++axis) lower[axis].resize(n), upper[axis].resize(n);
      node.resize(n), size = n;
    }
    void set(std::size_t i, const Bounds3f& box, std::uint32_t index) noexcept {
      for (std::size_t axis = 0; axis < 3; ++axis) lower[axis][i] = box.lower[axis], upper[axis][i] = box.upper[axis];
      node[i] = index;
    }
  };
  struct Result {
    std::size_t merged = 0, kept = 0;
  };

  template <class F>
  void for_chunks(const F& f) {
    const std::size_t n = current_.size;
    tbb::parallel_for(std::size_t{0}, (n + kChunk - 1) / kChunk,
                      [&](std::size_t c) { f(c, c * kChunk, std::min(n, (c + 1) * kChunk)); });
  }

  /// Areas of the boxes around i and each of the `count` clusters behind it.
  void areas_behind(std::size_t i, std::size_t count, float* area) const noexcept {
    float low[3], high[3];
    const float *l[3], *u[3];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      l[axis] = current_.lower[axis].data() + i, u[axis] = current_.upper[axis].data() + i;
      low[axis] = *l[axis]++, high[axis] = *u[axis]++;
    }
    for (std::size_t k = 0; k < count; ++k) {
      const float x = (u[0][k] > high[0] ? u[0][k] : high[0]) - (l[0][k] < low[0] ? l[0][k] : low[0]);
      const float y = (u[1][k] > high[1] ? u[1][k] : high[1]) - (l[1][k] < low[1] ? l[1][k] : low[1]);
      const float z = (u[2][k] > high[2] ? u[2][k] : high[2]) - (l[2][k] < low[2] ? l[2][k] : low[2]);
      area[k] = x * y + y * z + z * x;
    }
  }

  /// best_[i] = i xor the chosen partner, for [begin, end). A pair's area is computed once, but for those across a
  /// border.
  void find_best(std::size_t begin, std::size_t end) noexcept {
    std::uint64_t key[kChunk];  // area's bits, which order as the area does, then i xor j
    std::fill(key, key + (end - begin), std::numeric_limits<std::uint64_t>::max());
    float area[kMostPlocRadius];
    for (std::size_t i = begin > radius_ ? begin - radius_ : 0; i < end; ++i) {
      const std::size_t count = std::min<std::size_t>(radius_, current_.size - 1 - i);
      areas_behind(i, count, area);
      std::uint64_t own = std::numeric_limits<std::uint64_t>::max();
      for (std::size_t k = 0; k < count; ++k) {
        const std::size_t j = i + 1 + k;
        const std::uint64_t candidate =
            std::uint64_t{std::bit_cast<std::uint32_t>(area[k])} << 32 | std::uint32_t(i ^ j);
        own = std::min(own, candidate);
        if (j >= begin && j < end) key[j - begin] = std::min(key[j - begin], candidate);
      }
      if (i >= begin) key[i - begin] = std::min(key[i - begin], own);
    }
    for (std::size_t i = begin; i < end; ++i) best_[i] = std::uint32_t(key[i - begin]);
  }

  /// The partner of i, or i itself where the choice is not mutual (or, for neighbours, there is none).
  [[nodiscard]] std::size_t partner(std::size_t i) const noexcept {
    const std::size_t j = i ^ best_[i];
    return j < current_.size && best_[j] == best_[i] ? j : i;
  }

  std::size_t count_merges() {
    for_chunks([&](std::size_t c, std::size_t begin, std::size_t end) {
      Result r;
      for (std::size_t i = begin; i < end; ++i) {
        const std::size_t j = partner(i);
        r.merged += i < j, r.kept += i <= j;
      }
      results_[c] = r;
    });
    std::size_t merged = 0;
    for (std::size_t c = 0; c < (current_.size + kChunk - 1) / kChunk; ++c) merged += results_[c].merged;
    return merged;
  }

  /// The first of each pair becomes its node, numbered from `first_node` on; the second goes.
  void merge(std::uint32_t first_node) {
    Result before;
    for (std::size_t c = 0; c < (current_.size + kChunk - 1) / kChunk; ++c) {
      const Result own = std::exchange(results_[c], before);
      before.merged += own.merged, before.kept += own.kept;
    }
    for_chunks([&](std::size_t c, std::size_t begin, std::size_t end) {
      std::size_t out = results_[c].kept;
      std::uint32_t node = first_node + std::uint32_t(results_[c].merged);
      for (std::size_t i = begin; i < end; ++i) {
        const std::size_t j = partner(i);
        if (j < i) continue;
        const LinkedNode& a = tree_.nodes[current_.node[i]];
        if (i == j) {
          next_.set(out++, a.box(), current_.node[i]);
          continue;
        }
        Bounds3f box = a.box();
        box.extend(tree_.nodes[current_.node[j]].box());
        tree_.nodes[node] = LinkedNode::inner(box, current_.node[i], current_.node[j]);
        next_.set(out++, box, node++);
      }
    });
    next_.size = before.kept;
    std::swap(current_, next_);
  }

  const std::size_t radius_;
  LinkedTree& tree_;
  Clusters current_, next_;
  MeteredVector<std::uint32_t> best_;
  MeteredVector<Result> results_;
};

}  // namespace

void build_ploc(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, BinaryTree& tree,
                BuildReport& report) {
  PhaseClock phase(report);
  LinkedTree clusters;
  {
    MortonOrder order(mesh, parameters.morton_bits, MortonOrder::kAtOnce);
    order.refine_runs(kShortRun);
    phase.ends("order");
    Ploc(mesh, order, parameters.ploc_radius, clusters).run();
  }
  phase.ends("clusters");
  tree = lay_out(clusters, leaf_width);
  phase.ends("layout");
}

}  // namespace arboretum
