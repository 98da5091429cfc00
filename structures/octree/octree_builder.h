// How an octree is grown.
#pragma once

#include "structures/octree/octree.h"

namespace arboretum::octree {

/// Nodes, root first, and leaves; `nodes[k].first` of the leaf with list i is i.
struct Tree {
  Cube cube;
  MeteredVector<Node> nodes;
  LeafLists lists;
  float max_coordinate = 0.0f;
};

/// For a mesh that is not empty. Parallel in the caller's TBB arena, the same for any number of threads.
void build_tree(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, Tree& tree,
                BuildReport& report);

}  // namespace arboretum::octree
