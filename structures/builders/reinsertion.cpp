// Each pass looks, in parallel and without changing anything, for the best new place of every node; then moves are made
// one after another, the most gainful first. A move's gain is what it changes in the tree as it then is: one that no
// longer gains is taken back. So no locks are needed, no conflict can spoil the tree, and the result is the same for
// any number of threads. Things that lie within each other would become a chain; a move that brings anything below
// kMaxReinsertedDepth is not made.
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
constexpr unsigned kMostVisits = 1024;  ///< of one search: where all boxes overlap nothing can be left out

struct Move {
  float gain;
  std::uint32_t node, target;
};

class Reinsertion {
 public:
  explicit Reinsertion(LinkedTree& tree)
      : tree_(tree), nodes_(tree.nodes), parent_(tree.nodes.size()), height_(tree.nodes.size()) {
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
    while (listed-- > 0) height_[order[listed]] = height_from_children(order[listed]);
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

  /// Boxes from `index` up; returns by how much their areas grew.
  double refit_upwards(std::uint32_t index) noexcept {
    double grown = 0.0;
    for (; index != kNone; index = parent_[index]) {
      LinkedNode& node = nodes_[index];
      const LinkedNode &left = nodes_[node.left], &right = nodes_[node.right];
      const Vec3f lower = min(left.lower, right.lower), upper = max(left.upper, right.upper);
      if (lower == node.lower && upper == node.upper) break;
      grown += double(half_area(lower, upper)) - half_area(node.lower, node.upper);
      node.lower = lower, node.upper = upper;
    }
    return grown;
  }

  /// Takes the node out with its parent and puts both above `target`; returns by how much the inner nodes' areas grew.
  double move(std::uint32_t index, std::uint32_t target) noexcept {
    const std::uint32_t parent = parent_[index], brother = sibling(index), grandparent = parent_[parent];
    const double before = area(parent);
    replace_child(grandparent, parent, brother);
    double grown = refit_upwards(grandparent);
    replace_child(parent_[target], target, parent);
    LinkedNode& p = nodes_[parent];
    (p.left == index ? p.right : p.left) = target;
    parent_[target] = parent;
    p.lower = min(nodes_[index].lower, nodes_[target].lower), p.upper = max(nodes_[index].upper, nodes_[target].upper);
    grown += area(parent) - before;
    return grown + refit_upwards(parent_[parent]);
  }

  /// How many levels are below.
  [[nodiscard]] std::uint32_t height_from_children(std::uint32_t i) const noexcept {
    const LinkedNode& node = nodes_[i];
    return node.is_leaf() ? 0 : 1 + std::max(height_[node.left], height_[node.right]);
  }

  void update_heights(std::uint32_t index) noexcept {
    for (; index != kNone; index = parent_[index]) {
      const std::uint32_t height = height_from_children(index);
      if (height == height_[index]) break;
      height_[index] = height;
    }
  }

  bool try_move(std::uint32_t index, std::uint32_t target) noexcept {
    const std::uint32_t parent = parent_[index];
    if (parent == kNone || target == parent || parent_[target] == parent) return false;
    std::uint32_t depth = 0;  // of the node and the target when it is made
    for (std::uint32_t i = target; i != kNone; i = parent_[i], ++depth) {
      if (i == index) return false;  // an earlier move has put the target below
    }
    if (depth + std::max(height_[index], height_[target]) > kMaxReinsertedDepth) return false;
    const std::uint32_t brother = sibling(index), grandparent = parent_[parent];
    if (move(index, target) < 0.0) {
      // The parent, which now stands elsewhere, is right before and after what its old place changes.
      height_[parent] = height_from_children(parent);
      update_heights(grandparent);
      height_[parent] = height_from_children(parent);
      update_heights(parent_[parent]);
      return true;
    }
    (void)move(index, brother);
    return false;
  }

  LinkedTree& tree_;
  MeteredVector<LinkedNode>& nodes_;
  MeteredVector<std::uint32_t> parent_;
  MeteredVector<std::uint32_t> height_;  ///< 0 for a leaf
  MeteredVector<Move> moves_;
};

}  // namespace

bool reinsert(LinkedTree& tree, unsigned rounds) {
  Reinsertion passes(tree);
  unsigned done = 0;
  while (done < rounds && passes.pass()) ++done;
  return done > 0;
}

void reinsert(BinaryTree& tree, unsigned rounds, unsigned leaf_width, BuildReport& report) {
  if (tree.primitives.empty()) return;
  const bool duplicates = tree.duplicates;
  const double start = wall_seconds();
  // Laid out first: numbers, and with them the order among equal gains, then depend on the tree alone.
  LinkedTree linked = to_linked(std::move(tree));
  tree = lay_out(linked, leaf_width);
  linked = to_linked(std::move(tree));
  (void)reinsert(linked, rounds);
  tree = lay_out(linked, leaf_width);
  tree.duplicates = duplicates;
  report.phases.emplace_back("reinsertion", wall_seconds() - start);
}

}  // namespace arboretum
