#include "structures/builders/linked_tree.h"

#include <algorithm>
#include <utility>

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include "core/error.h"
#include "structures/builders/one_task.h"

namespace arboretum {
namespace {

constexpr unsigned kForkLevels = 8;  ///< where sizes are not known yet, the first levels are counted by tasks

class Layout {
 public:
  Layout(const LinkedTree& tree, unsigned leaf_width)
      : tree_(tree), leaf_width_(leaf_width), sizes_(tree.nodes.size()) {}

  BinaryTree run() {
    const Size all = count(tree_.root, 0);
    out_.nodes.resize(all.nodes), out_.first.resize(all.nodes), out_.primitives.resize(all.references);
    out_.node_count = all.nodes, out_.duplicates = tree_.duplicates;
    place(tree_.root, 0, 1, 0);
    return std::move(out_);
  }

 private:
  struct Size {
    std::uint32_t references, nodes;  ///< of the subtree; nodes as they are laid out
  };

  Size count(std::uint32_t index, unsigned level) {
    const LinkedNode& node = tree_.nodes[index];
    if (node.is_leaf()) return sizes_[index] = {node.size(), 1};
    Size left, right;
    if (level < kForkLevels) {
      tbb::parallel_invoke([&] { left = count(node.left, level + 1); }, [&] { right = count(node.right, level + 1); });
    } else {
      left = count(node.left, level + 1), right = count(node.right, level + 1);
    }
    const std::uint32_t references = left.references + right.references;
    return sizes_[index] = {references,
                            references <= leaf_width_ && !tree_.duplicates ? 1 : 1 + left.nodes + right.nodes};
  }

  /// Node `index` goes to `slot`, what is below to next, next + 1, ..., its references from `first` on.
  void place(std::uint32_t index, std::uint32_t slot, std::uint32_t next, std::uint32_t first) {
    const LinkedNode& node = tree_.nodes[index];
    const Size size = sizes_[index];
    const bool leaf = size.nodes == 1;
    out_.nodes[slot] = {node.lower, leaf ? 0 : next, node.upper, size.references};
    if (leaf) {
      out_.first[slot] = first;
      (void)append(index, out_.primitives.data() + first);
      return;
    }
    const Size left = sizes_[node.left];
    const auto place_left = [&] { place(node.left, next, next + 2, first); };
    const auto place_right = [&] { place(node.right, next + 1, next + 1 + left.nodes, first + left.references); };
    if (left.references > kOneTask && sizes_[node.right].references > kOneTask) {
      tbb::parallel_invoke(place_left, place_right);
    } else {
      place_left(), place_right();
    }
  }

  std::uint32_t* append(std::uint32_t index, std::uint32_t* to) const {
    const LinkedNode& node = tree_.nodes[index];
    if (!node.is_leaf()) return append(node.right, append(node.left, to));
    const std::uint32_t* from = tree_.primitives.data() + node.first();
    return std::copy(from, from + node.size(), to);
  }

  const LinkedTree& tree_;
  const unsigned leaf_width_;
  MeteredVector<Size> sizes_;
  BinaryTree out_;
};

}  // namespace

BinaryTree lay_out(const LinkedTree& tree, unsigned leaf_width) { return Layout(tree, leaf_width).run(); }

LinkedTree to_linked(const BinaryTree& tree) {
  if (tree.node_count > LinkedNode::kLeaf)
    throw UserError("reinsertion: a tree of more than 2^31 nodes; take wider leaf blocks or a smaller mesh");
  LinkedTree out;
  out.nodes.resize(tree.node_count);
  // Unused slots of the binary tree hold anything; nothing names them.
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, tree.node_count, kOneTask), [&](const auto& range) {
    for (std::size_t i = range.begin(); i < range.end(); ++i) {
      const BinaryNode& node = tree.nodes[i];
      const Bounds3f box{node.lower, node.upper};
      out.nodes[i] = node.is_leaf() ? LinkedNode::leaf(box, tree.first[i], node.count)
                                    : LinkedNode::inner(box, node.left, node.left + 1);
    }
  });
  out.primitives = tree.primitives, out.duplicates = tree.duplicates;
  return out;
}

}  // namespace arboretum
