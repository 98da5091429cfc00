// Reinsertion (Meister and Bittner, "Parallel Reinsertion for Bounding Volume Hierarchy Optimization", Eurographics
// 2018): subtrees move to where they make the tree's inner nodes smallest.
#pragma once

#include <cstdint>
#include <functional>

#include "structures/accel.h"
#include "structures/builders/binary_tree.h"
#include "structures/builders/linked_tree.h"

namespace arboretum {

/// No move brings a node deeper than this: what lays trees out, collapses, writes and refits them recurses, up to 2 KB
/// of a thread's stack a level. Trees of scenes are a fraction as deep (docs/structures.md); where a builder's tree is
/// deeper already (`ploc`, which may merge a single pair a round when 1024 clusters are left), what is below stays.
inline constexpr unsigned kMaxReinsertedDepth = 256;

/// What moves are weighed by, times areas: inner nodes, and leaves of whole blocks, which subtrees become where that
/// costs less. As it stands the sum of the inner nodes' areas.
struct ReinsertionCosts {
  float node = 1.0f;                      ///< of an inner node
  float leaf = 0.0f, block = 0.0f;        ///< of a leaf, and of each of its blocks
  unsigned block_width = 1;               ///< references that a block takes
  std::uint32_t max_leaf_references = 0;  ///< below inner nodes that may become leaves
};

/// Improves `tree` in `rounds` passes, fewer where nothing is left to gain, and lays it out again with leaves of at
/// most one block. Stays with the tree as it was unless `cost` is less afterwards. The result depends on the tree and
/// not on threads or on how its nodes are numbered. Runs in the caller's TBB arena; adds a phase to the report.
void reinsert(BinaryTree& tree, unsigned rounds, const ReinsertionCosts& costs,
              const std::function<double(const BinaryTree&)>& cost, BuildReport& report);

/// Improves `tree` in place, so that `costs` never grow; whether anything was gained. A node's number, which decides
/// between equal gains, should depend on the tree alone, and is less than its children's. What hangs below the leaves
/// does not count in depths.
bool reinsert(LinkedTree& tree, unsigned rounds, const ReinsertionCosts& costs = {});

}  // namespace arboretum
