// Uniform grid with 3-D DDA (Amanatides and Woo, Eurographics 1987), and its two-level form (Kalojanov,
// Billeter, Slusallek, Eurographics 2011): a coarse grid, each of whose crowded cells holds a grid of its
// own.
//
// A cell is 32 bits (structures/leaves/leaf_lists.h): empty, leaf blocks, or kNoLeaf with the number of the
// grid inside.
//
// Why no ray loses a triangle. Write u for 2^-24, M for the largest |coordinate| of the scene, L for its largest extent
// (at least M / 64). A triangle is put into every cell that it touches when the cell is widened by
//   pad = 16 u M + 256 u L
// on each side, and the grid's box is wider than the scene by as much. A ray's kernel answers t within 4 u (M + |o|) of
// the triangle (as box_test.h has it for padded boxes), |o| its origin's largest |coordinate|. The walk computes every
// plane's distance from the cell's index, nothing accumulates:
//   (face - o) * r - n * (cell * r),
// whose five roundings move the point where the walk changes cells by less than
//   8 u (|o - lower| + L)
// from the plane, the first cell's included, plus 2 u M for the float corners of inner grids. Where
// |o - lower| <= 16 L on each axis, |o| <= M + 16 L and the sum is below
//   4 u (2 M + 16 L) + 8 u * 17 L + 2 u M = 10 u M + 200 u L < pad.
// So the cell in which the walk is at t, whichever of two neighbours it takes, holds the triangle that is hit at t. The
// walk's intervals of t follow each other without a gap: where the last face of an inner grid is met before the face of
// the outer cell, which rounding parts, the ray stays in the last cells of the inner grid until it leaves the outer
// one. The walk ends where best.t lies before the end of the cell's interval: all that could answer with t <= best.t
// has been tested by then, ties included. `fast` relies on this for any ray. `padded` sends the rays outside these
// bounds (origins beyond 16 L, directions out of the range in which the constants stay normal) through the same cells
// as if they were the leaves of a tree with padded boxes (grid_far_single.h).
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>
#include <string>

#include "core/memory_meter.h"
#include "core/type_list.h"
#include "structures/accel.h"
#include "structures/leaves/leaf_lists.h"

namespace arboretum::grid {

/// One grid of cells, x fastest. 64 bytes, four lanes a group.
struct alignas(64) Level {
  float lower[4];       ///< corner; 0
  float cell[4];        ///< cell sizes; 0
  float inverse[4];     ///< 1 / cell; 0
  float last[3];        ///< cells on each axis less one, at most 65535
  std::uint32_t first;  ///< its first cell among all cells
  [[nodiscard]] std::uint32_t cells_on(int axis) const noexcept { return std::uint32_t(last[axis]) + 1u; }
  [[nodiscard]] std::uint64_t size() const noexcept { return std::uint64_t(cells_on(0)) * cells_on(1) * cells_on(2); }
};
static_assert(sizeof(Level) == 64);

/// Where face i of an axis lies; the last may be rounded to beyond what a float holds, and no triangle is there.
[[nodiscard]] inline float face(const Level& level, std::size_t axis, std::uint32_t i) noexcept {
  constexpr double largest = std::numeric_limits<float>::max();
  return float(std::clamp(level.lower[axis] + double(level.cell[axis]) * i, -largest, largest));
}

/// What a build makes: level 0 is the outer grid; cells are those of level 0, then of the inner grids in the
/// order of the cells that they fill.
struct Cells {
  MeteredVector<Level> levels;
  MeteredVector<LeafCode> codes;
  LeafLists lists;                                        ///< one a cell; dropped when the leaves are written
  float max_coordinate = 0.0f, pad = 0.0f, reach = 0.0f;  ///< M, pad and L of the proof
};

class Grid final : public Accel {
 public:
  static constexpr std::string_view kName = "grid";
  [[nodiscard]] static const StructureInfo& static_info();
  [[nodiscard]] const StructureInfo& info() const noexcept override { return static_info(); }
  /// Memory: at most kMostReferences references a triangle (each an entry of a leaf block) and 2 *
  /// grid_density + 8 cells a triangle, whatever the scene: cells grow until it fits. Throws UserError for
  /// parameters out of range and for 2^28 leaf blocks.
  void build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) override;
  /// A grid is a node whose children are its cells that are not empty; NodeView::steps is the number of cells
  /// that a random ray through it crosses, so that SAH charges a step for each. An inner grid is a node in
  /// place of its cell.
  [[nodiscard]] bool visit(StructureVisitor& visitor) const override;
  void archive(Archive& archive) override;
  [[nodiscard]] std::size_t bytes() const noexcept override;

  [[nodiscard]] const Level* levels() const noexcept { return levels_.data(); }
  [[nodiscard]] const LeafCode* codes() const noexcept { return codes_.data(); }
  [[nodiscard]] const LeafStore& leaves() const noexcept { return leaves_; }
  [[nodiscard]] float max_coordinate() const noexcept { return max_coordinate_; }
  [[nodiscard]] float pad() const noexcept { return pad_; }
  [[nodiscard]] float reach() const noexcept { return reach_; }

 private:
  MeteredVector<Level> levels_;
  MeteredVector<LeafCode> codes_;
  LeafStore leaves_;
  float max_coordinate_ = 0.0f, pad_ = 0.0f, reach_ = 0.0f;
  bool empty_ = true;
};

using Structures = TypeList<Grid>;

}  // namespace arboretum::grid
