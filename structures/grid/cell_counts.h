// How many cells a grid or a level of it has: nearly cubic ones, as many as are wanted and the expected number of
// references allows.
#pragma once

#include <array>
#include <cstdint>

#include "structures/grid/grid.h"

namespace arboretum::grid {

using Extent = std::array<double, 3>;
using Index3 = std::array<std::uint32_t, 3>;

/// Cells that a level has at most, but for rounding: their number takes 32 bits.
inline constexpr double kMostCells = 1e9;
static_assert(kMostCells * 64 / 27 < 0x1p32);  // rounding adds a third of the cells on each axis at most: 1.5 become 2

/// Sums from which the expected number of cells that triangles touch follows for any cell size: of a convex
/// body put down at random on a lattice that number is the volume of the body and the cell added (Minkowski),
/// for a triangle 1 + width / cell on each axis + projected area / cell face on each plane.
struct Sizes {
  Extent width{}, area{};  ///< area[a]: projected along axis a
  double triangles = 0;

  /// A triangle, of which no more counts than lies within a box of that size.
  void add(const std::array<Vec3f, 3>& corners, const Extent& most);
  void add(const Sizes& other);
  /// Expected, of the box cut into so many cells.
  [[nodiscard]] double references(const Extent& extent, const Index3& counts) const;
};

/// The most cells up to `wanted`, none narrower than `least`, with which no more than `limit` references are expected.
[[nodiscard]] Index3 counts_within(const Sizes& sizes, const Extent& extent, double wanted, double least, double limit);

/// A level of `counts` cells whose box holds [lower, lower + extent].
[[nodiscard]] Level make_level(const Vec3f& lower, const Extent& extent, const Index3& counts);

/// Cells that `share` of grid_density asks for a level of so many triangles.
[[nodiscard]] double wanted_cells(const BuilderParameters& parameters, double triangles, double share = 1.0);

/// Cells that a random ray through the level crosses, on average: the sum of their areas over its own
/// (Cauchy's formula).
[[nodiscard]] double expected_steps(const Level& level);

}  // namespace arboretum::grid
