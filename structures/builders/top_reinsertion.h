// Reinsertion of a tree's largest nodes alone, with which the top-down builders end: where a scene's triangles are of
// very different sizes nearly all that reinsertion gains lies there, for a hundredth of its time (docs/performance.md).
#pragma once

#include "structures/accel.h"
#include "structures/builders/binary_tree.h"

namespace arboretum {

/// Improves the top of `tree`, its `most` largest inner nodes (fewer in a small tree; below 2: none) and their
/// children. The sum of the inner nodes' areas never grows; references below a node stay consecutive; the result
/// depends on the tree alone. Runs in the caller's TBB arena; adds a phase to the report.
void reinsert_top(BinaryTree& tree, unsigned most, BuildReport& report);

}  // namespace arboretum
