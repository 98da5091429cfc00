// The builders that are written once for all instruction sets; builders.cpp lists them. Contract: BinaryBuilder in
// builders.h.
#pragma once

#include "structures/builders/builders.h"

namespace arboretum {

/// `morton`: linear BVH. Reads morton_bits.
void build_morton(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, BinaryTree& tree,
                  BuildReport& report);
/// The same cuts, with the leaf blocks filled while they are made. References are the blocks' lanes, empty ones too:
/// leaves merged from several are not packed anew, so what collapse() merges may be another thing.
void build_morton_in_blocks(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width,
                            LeafBlocks& blocks, BinaryTree& tree, BuildReport& report);

/// `ploc`: locally ordered clustering. Reads morton_bits and ploc_radius.
void build_ploc(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, BinaryTree& tree,
                BuildReport& report);

/// `sweep_sah`: every split between the sorted centroids is tried. Reads no parameter.
void build_sweep_sah(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width,
                     BinaryTree& tree, BuildReport& report);

}  // namespace arboretum
