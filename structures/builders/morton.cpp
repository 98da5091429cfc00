// Linear BVH (Lauterbach et al., Eurographics 2009): triangles in Morton order, cut from the top where the highest
// differing bit of the codes changes; boxes on the way back. Equal codes are cut in the middle, so a million of them
// are 20 levels.
//
// Unlike in the paper a range that a few leaf blocks hold is cut only where those are not made more, so that leaves are
// full.
#include <algorithm>
#include <utility>
#include <vector>

#include <tbb/concurrent_vector.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include "intersectors/blocks.h"
#include "structures/builders/box4.h"
#include "structures/builders/portable_builders.h"
#include "structures/builders/morton_order.h"
#include "structures/builders/node_pool.h"
#include "structures/builders/one_task.h"
#include "structures/builders/phase_clock.h"
#include "structures/leaves/leaf_blocks.h"

namespace arboretum {
namespace {

constexpr std::size_t kFewBlocks = 3;     ///< ranges of so many leaf blocks are cut where they fill no more
constexpr std::size_t kSmall = 1u << 17;  ///< so many triangles are sorted by 21 bits of their codes at first, in two
                                          ///< passes; more by 30 bits, in three

/// Leaves as ranges of BinaryTree::primitives.
class RangesOfIds {
 public:
  RangesOfIds(const MortonOrder& order, BinaryTree& tree) : order_(order), tree_(tree) {}
  /// How many places a leaf takes.
  [[nodiscard]] std::size_t places(std::size_t triangles) const noexcept { return triangles; }
  void make(std::size_t places) const { tree_.primitives.resize(places); }
  /// Makes a leaf of [begin, end) of the order, from `place` on; returns its box.
  Box4 leaf(const TriangleBoxes& boxes, std::uint32_t index, std::size_t begin, std::size_t end,
            std::size_t place) const noexcept {
    tree_.first[index] = std::uint32_t(place);
    Box4 box;
    for (std::size_t i = begin; i < end; ++i) box.extend(boxes.box(tree_.primitives[place++] = order_.id(i)));
    return box;
  }

 private:
  const MortonOrder& order_;
  BinaryTree& tree_;
};

/// Leaves as lanes of filled blocks.
class FilledBlocks {
 public:
  FilledBlocks(const TriangleMesh& mesh, const MortonOrder& order, unsigned width, LeafBlocks& blocks)
      : mesh_(mesh), order_(order), width_(width), blocks_(blocks) {}
  [[nodiscard]] std::size_t places(std::size_t) const noexcept { return width_; }
  void make(std::size_t places) const { blocks_.make(places / width_); }
  Box4 leaf(const TriangleBoxes&, std::uint32_t, std::size_t begin, std::size_t end, std::size_t place) const noexcept {
    std::uint32_t ids[kWidestBlock];
    for (std::size_t i = begin; i < end; ++i) ids[i - begin] = order_.id(i);
    Box4 box;
    blocks_.fill(place / width_, mesh_, {ids, end - begin}, box);
    return box;
  }

 private:
  const TriangleMesh& mesh_;
  const MortonOrder& order_;
  const unsigned width_;
  LeafBlocks& blocks_;
};

/// Where a leaf lies must not depend on scheduling: the whole order is cut before leaves are made.
template <class Leaves>
class Lbvh {
 public:
  Lbvh(const TriangleMesh& mesh, MortonOrder& order, unsigned leaf_width, const Leaves& leaves, BinaryTree& tree)
      : boxes_(mesh), order_(order), leaf_width_(leaf_width), leaves_(leaves), tree_(tree),
        pool_(tree, order.size(), kOneTask) {}

  void build() {
    cut_into_tasks({0, 0, order_.size(), order_.sorted_bits()});
    std::vector<Task*> tasks;
    for (Task& task : tasks_) tasks.push_back(&task);
    std::ranges::sort(tasks, {}, &Task::begin);
    const auto for_tasks = [&](const auto& f) {
      tbb::parallel_for(std::size_t{0}, tasks.size(), [&](std::size_t i) { f(*tasks[i]); });
    };
    for_tasks([this](Task& t) {
      if (t.places == 0) t.places = cut(t.index, t.begin, t.end, t.sorted, t.share);
    });
    std::size_t all = 0;
    for (Task* t : tasks) t->place = std::exchange(all, all + t->places);
    leaves_.make(all);
    for_tasks([this](Task& t) { (void)fill(t.index, t.begin, t.place); });
    pool_.finish();
    auto task = tasks.begin();
    (void)join(0, task);
  }

 private:
  /// A subtree that one task makes, of [begin, end).
  struct Task {
    std::uint32_t index;
    std::size_t begin, end;
    unsigned sorted;  ///< bits that the range is sorted by
    NodePool::Share share{};
    std::size_t places = 0;  ///< that its leaves take; 0 until it is cut
    std::size_t place = 0;   ///< the first of them
  };

  std::size_t split(std::size_t begin, std::size_t end, unsigned& sorted) {
    while (order_.refinable(begin, end, sorted)) sorted = order_.refine(begin, end, sorted);
    return end - begin <= kFewBlocks * leaf_width_ ? order_.split_into_blocks(begin, end, leaf_width_)
                                                   : order_.split(begin, end);
  }

  /// The upper nodes: those of which a side is too large for a task. A small side beside a large one is cut at once, so
  /// that shares are as few as NodePool reckons.
  void cut_into_tasks(Task task) {
    if (task.end - task.begin <= 2 * kOneTask) {
      tasks_.push_back(task);
      return;
    }
    const std::size_t middle = split(task.begin, task.end, task.sorted);
    const std::uint32_t left = tree_.nodes[task.index].left = pool_.take_pair(task.share);
    Task sides[2] = {{left, task.begin, middle, task.sorted}, {left + 1, middle, task.end, task.sorted}};
    const bool large[2] = {middle - task.begin > kOneTask, task.end - middle > kOneTask};
    if (large[0] && large[1]) {
      sides[1].share = task.share;
      tbb::parallel_invoke([&] { cut_into_tasks(sides[0]); }, [&] { cut_into_tasks(sides[1]); });
      return;
    }
    Task& small = sides[large[0] ? 1 : 0];
    small.places = cut(small.index, small.begin, small.end, small.sorted, task.share);
    tasks_.push_back(small);
    Task& rest = sides[large[0] ? 0 : 1];
    rest.share = task.share;
    cut_into_tasks(rest);
  }

  /// Links the nodes of a subtree and notes the triangles of leaves; returns how many places those take.
  std::size_t cut(std::uint32_t index, std::size_t begin, std::size_t end, unsigned sorted, NodePool::Share& share) {
    BinaryNode& node = tree_.nodes[index];
    if (end - begin <= leaf_width_) {
      node.left = 0, node.count = std::uint32_t(end - begin);
      return leaves_.places(end - begin);
    }
    const std::size_t middle = split(begin, end, sorted);
    const std::uint32_t left = node.left = pool_.take_pair(share);
    const std::size_t before = cut(left, begin, middle, sorted, share);
    return before + cut(left + 1, middle, end, sorted, share);
  }

  /// Makes the leaves of a subtree that was cut, from `begin` of the order and `place` on; both go on behind it.
  Box4 fill(std::uint32_t index, std::size_t& begin, std::size_t& place) noexcept {
    BinaryNode& node = tree_.nodes[index];
    const std::size_t first = place;
    Box4 box;
    if (node.is_leaf()) {
      const std::size_t end = begin + node.count;
      boxes_.prefetch([&](std::size_t i) { return order_.id(i); }, begin, end, order_.size() - 1);
      box = leaves_.leaf(boxes_, index, begin, end, place);
      begin = end, place += leaves_.places(node.count);
    } else {
      box = fill(node.left, begin, place);
      box.extend(fill(node.left + 1, begin, place));
    }
    node.lower = to_vec3f(box.lower), node.upper = to_vec3f(box.upper), node.count = std::uint32_t(place - first);
    return box;
  }

  /// Boxes of the upper nodes; `task` is the first below `index`, then the one behind.
  Bounds3f join(std::uint32_t index, typename std::vector<Task*>::iterator& task) noexcept {
    BinaryNode& node = tree_.nodes[index];
    if (index == (*task)->index) {
      ++task;
    } else {
      Bounds3f box = join(node.left, task);
      box.extend(join(node.left + 1, task));
      node.lower = box.lower, node.upper = box.upper;
      node.count = tree_.nodes[node.left].count + tree_.nodes[node.left + 1].count;
    }
    return {node.lower, node.upper};
  }

  const TriangleBoxes boxes_;
  MortonOrder& order_;
  const unsigned leaf_width_;
  const Leaves leaves_;
  BinaryTree& tree_;
  NodePool pool_;
  tbb::concurrent_vector<Task> tasks_;
};

/// `make_leaves(order)`: what makes them.
template <class MakeLeaves>
void build(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, BinaryTree& tree,
           BuildReport& report, const MakeLeaves& make_leaves) {
  PhaseClock phase(report);
  MortonOrder order(mesh, parameters.morton_bits, mesh.size() <= kSmall ? 21 : MortonOrder::kAtOnce);
  phase.ends("order");
  Lbvh(mesh, order, leaf_width, make_leaves(order), tree).build();
  phase.ends("tree");
}

}  // namespace

void build_morton(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, BinaryTree& tree,
                  BuildReport& report) {
  build(mesh, parameters, leaf_width, tree, report, [&](const MortonOrder& order) { return RangesOfIds(order, tree); });
}

void build_morton_in_blocks(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width,
                            LeafBlocks& blocks, BinaryTree& tree, BuildReport& report) {
  tree.in_blocks = true;
  build(mesh, parameters, leaf_width, tree, report,
        [&](const MortonOrder& order) { return FilledBlocks(mesh, order, leaf_width, blocks); });
}

}  // namespace arboretum
