// Each pass looks, in parallel and without changing anything, for the place of every node where the inner nodes' areas
// are least; then moves are made one after another, the most gainful first. What a move is worth is what it changes of
// the cost of the tree as it then is, some subtrees of which are leaves: one that gains nothing there is taken back. So
// no locks are needed, no conflict can spoil the tree, and the result is the same for any number of threads. Things
// that lie within each other would become a chain; a move that brings anything below kMaxReinsertedDepth is not made.
#include "structures/builders/reinsertion.h"

#include <algorithm>
#include <vector>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include "core/timer.h"
#include "structures/builders/linked_tree.h"

namespace arboretum {
namespace {

constexpr std::uint32_t kNone = ~0u;
constexpr std::size_t kGrain = 128;
constexpr std::uint32_t kMany = 1u << 30;  ///< references, more than any leaf holds
constexpr unsigned kMostVisits = 1024;     ///< of one search: where all boxes overlap nothing can be left out

struct Move {
  float gain;
  std::uint32_t node, target;
};

class Reinsertion {
 public:
  Reinsertion(LinkedTree& tree, const ReinsertionCosts& costs)
      : tree_(tree), costs_(costs), nodes_(tree.nodes), parent_(tree.nodes.size()), below_(tree.nodes.size()) {
    parent_[tree.root] = kNone;
    MeteredVector<std::uint32_t> order(nodes_.size());  // parents before their children, wherever they stand
    std::size_t listed = 0;
    order[listed++] = tree.root;
    for (std::size_t k = 0; k < listed; ++k) {
      const LinkedNode& node = nodes_[order[k]];
      if (node.is_leaf()) continue;
      parent_[node.left] = parent_[node.right] = order[k];
      order[listed++] = node.left, order[listed++] = node.right;
    }
    while (listed-- > 0) below_[order[listed]] = below_from_children(order[listed]);
  }

  /// Whether anything was gained.
  bool pass() {
    moves_.resize(nodes_.size());
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, nodes_.size(), kGrain), [&](const auto& range) {
      std::vector<Step> stack;
      for (std::size_t i = range.begin(); i < range.end(); ++i) moves_[i] = best_move(std::uint32_t(i), stack);
    });
    moves_.erase(std::remove_if(moves_.begin(), moves_.end(), [](const Move& m) { return !(m.gain > 0.0f); }),
                 moves_.end());
    tbb::parallel_sort(moves_.begin(), moves_.end(), [](const Move& a, const Move& b) {
      return a.gain != b.gain ? a.gain > b.gain : a.node < b.node;
    });
    bool gained = false;
    for (const Move& move : moves_) gained |= try_move(move.node, move.target);
    return gained;
  }

 private:
  /// A place to look at, with the area saved so far on the way to it.
  struct Step {
    float saved;
    std::uint32_t node;
  };

  [[nodiscard]] float area(std::uint32_t i) const noexcept { return half_area(nodes_[i].lower, nodes_[i].upper); }
  [[nodiscard]] std::uint32_t sibling(std::uint32_t i) const noexcept {
    const LinkedNode& p = nodes_[parent_[i]];
    return p.left == i ? p.right : p.left;
  }

  /// Looks below each ancestor's other child, nearest ancestors first, and leaves out what cannot beat the best so far:
  /// the new parent is at least as large as the node.
  [[nodiscard]] Move best_move(std::uint32_t index, std::vector<Step>& stack) const {
    Move best{0.0f, index, kNone};
    const std::uint32_t parent = parent_[index];
    if (parent == kNone) return best;
    const LinkedNode& node = nodes_[index];
    const float own = area(index);
    float saved = area(parent);
    std::uint32_t pivot = index;
    unsigned visits = 0;
    Bounds3f rest;  // the ancestor `parent_[pivot]` without the node
    for (;;) {
      const std::uint32_t other = sibling(pivot), ancestor = parent_[pivot];
      stack.push_back({saved, other});
      while (!stack.empty()) {
        const Step step = stack.back();
        stack.pop_back();
        if (step.saved - own <= best.gain) continue;
        if (++visits > kMostVisits) {
          stack.clear();
          return best;
        }
        const LinkedNode& at = nodes_[step.node];
        const float common = half_area(min(at.lower, node.lower), max(at.upper, node.upper));
        if (step.saved - common > best.gain) best.gain = step.saved - common, best.target = step.node;
        if (at.is_leaf()) continue;
        const float below = step.saved + half_area(at.lower, at.upper) - common;
        if (below - own > best.gain) stack.push_back({below, at.right}), stack.push_back({below, at.left});
      }
      rest.extend(nodes_[other].box());
      if (pivot != index) saved += area(ancestor) - half_area(rest.lower, rest.upper);
      pivot = ancestor;
      if (parent_[pivot] == kNone) return best;
    }
  }

  void replace_child(std::uint32_t parent, std::uint32_t child, std::uint32_t by) noexcept {
    parent_[by] = parent;
    if (parent == kNone) {
      tree_.root = by;
    } else {
      (nodes_[parent].left == child ? nodes_[parent].left : nodes_[parent].right) = by;
    }
  }

  /// What is below a node, itself included.
  struct Below {
    double cost;               ///< times area
    std::uint32_t references;  ///< at most kMany
    std::uint32_t height;      ///< levels; 0 for a leaf
    bool operator==(const Below&) const = default;
  };

  [[nodiscard]] Below below_from_children(std::uint32_t i) const noexcept {
    const LinkedNode& node = nodes_[i];
    if (node.is_leaf()) return {leaf_cost(i, node.size()), std::min(node.size(), kMany), 0};
    const Below &left = below_[node.left], &right = below_[node.right];
    Below all{double(area(i)) * costs_.node + left.cost + right.cost,
              std::min(left.references + right.references, kMany), 1 + std::max(left.height, right.height)};
    if (all.references <= costs_.max_leaf_references) all.cost = std::min(all.cost, leaf_cost(i, all.references));
    return all;
  }
  [[nodiscard]] double leaf_cost(std::uint32_t i, std::uint32_t references) const noexcept {
    const std::uint32_t blocks = (references + costs_.block_width - 1) / costs_.block_width;
    return double(area(i)) * (costs_.leaf + double(costs_.block) * blocks);
  }

  /// Boxes, and what is below, from `index` up.
  void refit_upwards(std::uint32_t index) noexcept {
    for (; index != kNone; index = parent_[index]) {
      LinkedNode& node = nodes_[index];
      const LinkedNode &left = nodes_[node.left], &right = nodes_[node.right];
      const Vec3f lower = min(left.lower, right.lower), upper = max(left.upper, right.upper);
      const bool same_box = lower == node.lower && upper == node.upper;
      node.lower = lower, node.upper = upper;
      const Below below = below_from_children(index);
      if (same_box && below == below_[index]) break;
      below_[index] = below;
    }
  }

  /// Takes the node out with its parent and puts both above `target`.
  void move(std::uint32_t index, std::uint32_t target) noexcept {
    const std::uint32_t parent = parent_[index], brother = sibling(index), grandparent = parent_[parent];
    replace_child(grandparent, parent, brother);
    refit_upwards(grandparent);
    replace_child(parent_[target], target, parent);
    LinkedNode& p = nodes_[parent];
    (p.left == index ? p.right : p.left) = target;
    parent_[target] = parent;
    p.lower = min(nodes_[index].lower, nodes_[target].lower), p.upper = max(nodes_[index].upper, nodes_[target].upper);
    below_[parent] = below_from_children(parent);
    refit_upwards(parent_[parent]);
  }

  bool try_move(std::uint32_t index, std::uint32_t target) noexcept {
    const std::uint32_t parent = parent_[index];
    if (parent == kNone || target == parent || parent_[target] == parent) return false;
    std::uint32_t depth = 0;  // of the node and the target when it is made
    for (std::uint32_t i = target; i != kNone; i = parent_[i], ++depth) {
      if (i == index) return false;  // an earlier move has put the target below
    }
    if (depth + std::max(below_[index].height, below_[target].height) > kMaxReinsertedDepth) return false;
    const std::uint32_t brother = sibling(index);
    const double before = below_[tree_.root].cost;
    move(index, target);
    if (below_[tree_.root].cost < before) return true;
    move(index, brother);
    return false;
  }

  LinkedTree& tree_;
  const ReinsertionCosts costs_;
  MeteredVector<LinkedNode>& nodes_;
  MeteredVector<std::uint32_t> parent_;
  MeteredVector<Below> below_;
  MeteredVector<Move> moves_;
};

}  // namespace

bool reinsert(LinkedTree& tree, unsigned rounds, const ReinsertionCosts& costs) {
  Reinsertion passes(tree, costs);
  unsigned done = 0;
  while (done < rounds && passes.pass()) ++done;
  return done > 0;
}

void reinsert(BinaryTree& tree, unsigned rounds, const ReinsertionCosts& costs,
              const std::function<double(const BinaryTree&)>& cost, BuildReport& report) {
  if (tree.primitives.empty()) return;
  const double start = wall_seconds();
  // Laid out first: numbers, and with them the order among equal gains, then depend on the tree alone.
  LinkedTree linked = to_linked(lay_out(to_linked(tree), costs.block_width));
  if (reinsert(linked, rounds, costs)) {
    BinaryTree better = lay_out(linked, costs.block_width);
    linked = {};
    if (cost(better) < cost(tree)) tree = std::move(better);
  }
  report.phases.emplace_back("reinsertion", wall_seconds() - start);
}

}  // namespace arboretum
