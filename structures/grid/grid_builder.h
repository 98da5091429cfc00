// How a grid's cells are chosen and filled.
#pragma once

#include "structures/grid/grid.h"

namespace arboretum::grid {

/// References a triangle at most, in the outer grid and in the inner grids of one of its references.
inline constexpr unsigned kOuterReferences = 6, kInnerReferences = 6;
inline constexpr unsigned kMostReferences = kOuterReferences * kInnerReferences;

/// Cells of the outer grid of two, as a share of those that one grid alone would have.
inline constexpr double kOuterShare = 1.0 / 32;

/// Cells and their triangles for a mesh that is not empty. `leaf_width` triangles cost one block. Parallel in
/// the caller's TBB arena, the same for any number of threads.
void build_cells(const TriangleMesh& mesh, const BuilderParameters& parameters, bool two_level, unsigned leaf_width,
                 Cells& cells, BuildReport& report);

}  // namespace arboretum::grid
