#include "structures/builders/refit.h"

#include <tbb/parallel_invoke.h>

#include "structures/builders/one_task.h"

namespace arboretum {
namespace {

Bounds3f refit_subtree(BinaryTree& tree, const TriangleMesh& mesh, std::uint32_t index) {
  BinaryNode& node = tree.nodes[index];
  Bounds3f box, other;
  if (node.is_leaf()) {
    for (std::uint32_t i = tree.first[index]; i < tree.first[index] + node.count; ++i)
      box.extend(mesh.bounds(tree.primitives[i]));
  } else if (node.count > kOneTask) {
    tbb::parallel_invoke([&] { box = refit_subtree(tree, mesh, node.left); },
                         [&] { other = refit_subtree(tree, mesh, node.left + 1); });
  } else {
    box = refit_subtree(tree, mesh, node.left), other = refit_subtree(tree, mesh, node.left + 1);
  }
  box.extend(other);
  node.lower = box.lower, node.upper = box.upper;
  return box;
}

}  // namespace

void refit(BinaryTree& tree, const TriangleMesh& mesh) {
  if (!tree.primitives.empty()) (void)refit_subtree(tree, mesh, 0);
}

}  // namespace arboretum
