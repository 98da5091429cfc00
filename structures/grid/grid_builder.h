// How a grid's cells are chosen and filled.
#pragma once

#include "structures/grid/grid.h"

namespace arboretum::grid {

/// References a triangle at most, in the outer grid and in the inner grids of one of its references.
inline constexpr unsigned kOuterReferences = 6, kInnerReferences = 6;
inline constexpr unsigned kMostReferences = kOuterReferences * kInnerReferences;

/// Cells of the outer grid of two, as a share of those that one grid alone would have.
inline constexpr double kOuterShare = 1.0 / 32;

/// Cells that a level has at most, but for rounding: their number takes 32 bits.
inline constexpr double kMostCells = 1e9;
static_assert(kMostCells * 64 / 27 < 0x1p32);  // rounding adds a third of the cells on each axis at most: 1.5 become 2

/// Cells that `share` of grid_density asks for a level of so many triangles.
[[nodiscard]] double wanted_cells(const BuilderParameters& parameters, double triangles, double share = 1.0);

/// Cells that a random ray through the level crosses, on average: the sum of their areas over its own
/// (Cauchy's formula).
[[nodiscard]] double expected_steps(const Level& level);

/// Cells and their triangles for a mesh that is not empty. `leaf_width` triangles cost one block. Parallel in
/// the caller's TBB arena, the same for any number of threads.
void build_cells(const TriangleMesh& mesh, const BuilderParameters& parameters, bool two_level,
                 unsigned leaf_width, Cells& cells, BuildReport& report);

}  // namespace arboretum::grid
