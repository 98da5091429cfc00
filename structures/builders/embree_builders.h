// Embree's builders for our BVHs, through rtcBuildBVH: what is the builder's merit can then be told from what is the
// kernel's. Only where libembree is there (ARBORETUM_HAVE_EMBREE). Contract: BinaryBuilder in builders.h.
#pragma once

#include "structures/builders/builders.h"

namespace arboretum {

/// `embree_low`: Embree's Morton builder, with its own codes of 30 bits.
void build_embree_low(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width,
                      BinaryTree& tree, BuildReport& report);
/// `embree_medium`: its binned SAH builder. Reads traversal_cost and intersection_cost, as embree_high does.
void build_embree_medium(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width,
                         BinaryTree& tree, BuildReport& report);
/// `embree_high`: the same with spatial splits. Reads duplication_budget; Embree's own scenes stop at 0.2.
void build_embree_high(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width,
                       BinaryTree& tree, BuildReport& report);

}  // namespace arboretum
