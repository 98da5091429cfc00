// The builders of binary trees, by name and instruction set.
#pragma once

#include "core/mesh.h"
#include "structures/accel.h"
#include "structures/builders/binary_tree.h"

namespace arboretum {

/// Builds a binary tree with leaves of at most `leaf_width` references (more only when max leaves say so). Deterministic:
/// the tree depends on the mesh, the parameters and `leaf_width`, not on threads or ISA. Runs in the caller's TBB arena.
using BinaryBuilder = void (*)(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width,
                               BinaryTree& tree, BuildReport& report);

/// Throws UserError where there is no such builder.
[[nodiscard]] BinaryBuilder binary_builder(std::string_view name, Isa isa);

}  // namespace arboretum
