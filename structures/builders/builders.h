// The builders of binary trees, by name.
#pragma once

#include <functional>
#include <string_view>
#include <vector>

#include "core/mesh.h"
#include "structures/accel.h"
#include "structures/builders/binary_tree.h"
#include "structures/parameter_limits.h"

namespace arboretum {

class LeafBlocks;

/// Builds a binary tree with leaves of at most `leaf_width` references. Deterministic: the tree depends on the mesh,
/// the parameters, `leaf_width` and whether leaf blocks are filled (TreeUse::blocks), not on threads or ISA. Runs in
/// the caller's TBB arena. The mesh may be empty: then the tree is, too.
using BinaryBuilder = void (*)(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width,
                               BinaryTree& tree, BuildReport& report);

/// What a structure makes of a binary tree, for `..._reinsertion`: of two trees it keeps the one that costs less.
struct TreeUse {
  unsigned branching = 2;                           ///< most children of a node
  std::function<double(const BinaryTree&)> cost{};  ///< in any unit, the less the better; none: of the tree as it is
  LeafBlocks* blocks = nullptr;                     ///< where a builder that can may fill them: BinaryTree::in_blocks
};

/// Every builder that makes a binary tree; the first is the default.
[[nodiscard]] const std::vector<std::string_view>& binary_builder_names();

/// Builds with settings.builder, using kernels of settings.isa. Throws UserError where there is no such builder, and
/// for parameters out of range.
void build_binary_tree(const TriangleMesh& mesh, const BuildSettings& settings, unsigned leaf_width, BinaryTree& tree,
                       BuildReport& report, const TreeUse& use = {});

/// Throws UserError where so many triangles and, of those, a share `budget` of references more are above
/// kMaxReferences.
void require_budget(std::string_view builder, std::size_t triangles, float budget);

}  // namespace arboretum
