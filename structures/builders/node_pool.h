// NodePool: nodes of a BinaryTree for builders whose tasks make them at the same time.
#pragma once

#include <cstddef>
#include <cstdint>

#include <tbb/task_arena.h>

#include "structures/builders/binary_tree.h"
#include "structures/builders/number_runs.h"

namespace arboretum {

/// Gives out pairs of neighbouring nodes from 1 on (0 is the root), with room for the worst case and counted as they
/// go. Each task owns a Share and takes nodes in blocks, so that its own lie together; numbers depend on scheduling,
/// the tree need not.
class NodePool {
 public:
  using Share = NumberRuns::Share;

  /// For a tree of n references, when shares are those of tasks for subtrees of more than `grain` of them, and one for
  /// each place in the arena.
  NodePool(BinaryTree& tree, std::size_t n, std::size_t grain) : tree_(tree) {
    // Fewer than n / grain + 1 shares (both sides of a split into tasks are larger than that) leave a block unfinished
    // each, and one for each place in the arena.
    const std::size_t shares = n / grain + 2 + std::size_t(tbb::this_task_arena::max_concurrency());
    tree.nodes.reserve(2 * n + shares * kBlock);
    if (!tree.in_blocks) tree.first.reserve(tree.nodes.size());
    count(1);
  }
  NodePool(const NodePool&) = delete;
  NodePool& operator=(const NodePool&) = delete;

  /// The first of two.
  [[nodiscard]] std::uint32_t take_pair(Share& share) noexcept {
    return numbers_.take(2, share, [this] { count(kBlock); });
  }

  /// To be called when the tree is done.
  void finish() noexcept { tree_.node_count = numbers_.end(); }

 private:
  static constexpr std::uint32_t kBlock = 64;
  void count(std::size_t n) noexcept {
    tree_.nodes.hand_out(n);
    if (!tree_.in_blocks) tree_.first.hand_out(n);
  }

  BinaryTree& tree_;
  NumberRuns numbers_{1, kBlock};
};

}  // namespace arboretum
