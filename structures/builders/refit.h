// Refit: a tree's boxes for moved vertices, its shape as it was.
#pragma once

#include "core/mesh.h"
#include "structures/builders/binary_tree.h"

namespace arboretum {

/// Fits every box of `tree` to `mesh`, which has the triangles that the tree was built from, their vertices moved.
/// Leaves of splitting builders get the boxes of whole triangles. Runs in the caller's TBB arena.
void refit(BinaryTree& tree, const TriangleMesh& mesh);

}  // namespace arboretum
