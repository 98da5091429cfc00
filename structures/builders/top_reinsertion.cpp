// The top of the tree, its largest nodes with what hangs below them as leaves, becomes a small tree of its own;
// reinsertion improves that, and the result takes the places of the old top. Subtrees below stay where they are; only
// their references move, so that those below a node stand together.
#include "structures/builders/top_reinsertion.h"

#include <algorithm>
#include <queue>
#include <vector>

#include <tbb/parallel_for.h>

#include "core/timer.h"
#include "structures/builders/linked_tree.h"
#include "structures/builders/reinsertion.h"

namespace arboretum {
namespace {

constexpr unsigned kRounds = 2;  ///< a third gains a hundredth of what two do
/// of a tree for each node that is opened, or small trees would take long
constexpr std::size_t kReferencesEach = 256;

class Top {
 public:
  /// The `opened` largest inner nodes of the tree, and their children. Numbers depend on the tree's shape and not on
  /// where its nodes stand.
  Top(BinaryTree& tree, std::size_t opened) : tree_(tree) {
    using Entry = std::pair<float, std::uint32_t>;  // area, number in the top
    const auto after = [](const Entry& a, const Entry& b) {
      return a.first != b.first ? a.first < b.first : a.second > b.second;
    };
    std::priority_queue<Entry, std::vector<Entry>, decltype(after)> largest(after);
    const auto add = [&](std::uint32_t node) {
      const std::uint32_t number = std::uint32_t(top_.nodes.size());
      top_.nodes.push_back(
          LinkedNode::leaf({tree_.nodes[node].lower, tree_.nodes[node].upper}, number, tree_.nodes[node].count));
      hanging_.push_back({tree_.nodes[node], node, 0, 0});
      if (!tree_.nodes[node].is_leaf()) largest.emplace(tree_.nodes[node].half_area(), number);
    };
    add(0);
    while (pairs_.size() < opened && !largest.empty()) {
      const std::uint32_t number = largest.top().second;
      largest.pop();
      const std::uint32_t pair = hanging_[number].node.left;
      pairs_.push_back(pair);
      LinkedNode& node = top_.nodes[number];
      node = LinkedNode::inner(node.box(), std::uint32_t(top_.nodes.size()), std::uint32_t(top_.nodes.size()) + 1);
      add(pair), add(pair + 1);
    }
  }

  /// Makes the tree the better one, where there is anything to gain.
  void improve() {
    if (!reinsert(top_, kRounds)) return;
    // Where references begin now is asked before anything is overwritten.
    for (std::size_t i = 0; i < hanging_.size(); ++i) {
      if (top_.nodes[i].is_leaf()) hanging_[i].begin = tree_.begin_of(hanging_[i].place);
    }
    write();
    move_references();
  }

 private:
  /// A node of the old top. Of those that hang below the new one the place and where references begin, before and
  /// after.
  struct Hanging {
    BinaryNode node;
    std::uint32_t place;
    std::uint32_t begin, new_begin;
  };

  /// Writes the new top, and to `hanging_` where what hangs below it now stands and where its references shall.
  void write() {
    struct Step {
      std::uint32_t number, place;
    };
    std::vector<Step> stack{{top_.root, 0}}, inner;
    std::uint32_t begin = 0;
    while (!stack.empty()) {
      const Step step = stack.back();
      stack.pop_back();
      const LinkedNode& node = top_.nodes[step.number];
      if (node.is_leaf()) {
        Hanging& old = hanging_[step.number];
        tree_.nodes[step.place] = old.node;
        if (old.node.is_leaf()) tree_.first[step.place] = old.begin;
        old.place = step.place, old.new_begin = begin;
        begin += old.node.count;
        continue;
      }
      const std::uint32_t pair = pairs_[inner.size()];
      tree_.nodes[step.place] = {node.lower, pair, node.upper, 0};
      inner.push_back(step);
      stack.push_back({node.right, pair + 1}), stack.push_back({node.left, pair});
    }
    // Children were written after their parents.
    for (std::size_t i = inner.size(); i-- > 0;) {
      BinaryNode& node = tree_.nodes[inner[i].place];
      node.count = tree_.nodes[node.left].count + tree_.nodes[node.left + 1].count;
    }
  }

  void move_references() {
    MeteredVector<std::uint32_t> primitives(tree_.nodes[0].count);
    tbb::parallel_for(std::size_t{0}, hanging_.size(), [&](std::size_t i) {
      if (!top_.nodes[i].is_leaf()) return;
      const Hanging& h = hanging_[i];
      std::copy_n(tree_.primitives.begin() + h.begin, h.node.count, primitives.begin() + h.new_begin);
      if (h.begin != h.new_begin) shift(h.place, h.new_begin - h.begin);
    });
    tree_.primitives.swap(primitives);
  }

  /// Moves where the references of all leaves below begin by `distance`, modulo 2^32.
  void shift(std::uint32_t root, std::uint32_t distance) {
    std::vector<std::uint32_t> stack{root};
    while (!stack.empty()) {
      const std::uint32_t index = stack.back();
      stack.pop_back();
      if (const BinaryNode& node = tree_.nodes[index]; node.is_leaf()) {
        tree_.first[index] += distance;
      } else {
        stack.push_back(node.left + 1), stack.push_back(node.left);
      }
    }
  }

  BinaryTree& tree_;
  LinkedTree top_;
  std::vector<Hanging> hanging_;      ///< one a node of the top
  std::vector<std::uint32_t> pairs_;  ///< places of children in the tree, one a node that was opened
};

}  // namespace

void reinsert_top(BinaryTree& tree, unsigned most, BuildReport& report) {
  if (tree.primitives.empty()) return;
  const std::size_t opened = std::min<std::size_t>(most, tree.nodes[0].count / kReferencesEach);
  if (opened < 2) return;
  const double start = wall_seconds();
  Top(tree, opened).improve();
  report.phases.emplace_back("reinsertion", wall_seconds() - start);
}

}  // namespace arboretum
