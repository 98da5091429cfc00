// Reinsertion (Meister and Bittner, "Parallel Reinsertion for Bounding Volume Hierarchy Optimization", Eurographics
// 2018): subtrees move to where they make the tree's inner nodes smallest.
#pragma once

#include "structures/accel.h"
#include "structures/builders/binary_tree.h"
#include "structures/builders/linked_tree.h"

namespace arboretum {

/// No move brings a node deeper than this: what lays trees out, collapses, writes and refits them recurses, up to 2 KB
/// of a thread's stack a level. Trees of scenes are a fraction as deep (docs/structures.md); where a builder's tree is
/// deeper already (`ploc`, which may merge a single pair a round when 1024 clusters are left), what is below stays.
inline constexpr unsigned kMaxReinsertedDepth = 256;

/// Improves `tree` in `rounds` passes, fewer where nothing is left to gain, and lays it out again with leaves of at
/// most `leaf_width` references. The sum of the inner nodes' areas never grows. The result depends on the tree and not
/// on threads or on how its nodes are numbered. Runs in the caller's TBB arena; adds phases to the report.
void reinsert(BinaryTree& tree, unsigned rounds, unsigned leaf_width, BuildReport& report);

/// Improves `tree` in place as above; whether anything was gained. A node's number, which decides between equal gains,
/// should depend on the tree alone, and is less than its children's. What hangs below the leaves does not count in
/// depths.
bool reinsert(LinkedTree& tree, unsigned rounds);

}  // namespace arboretum
