// Which cells of one level a triangle touches.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "structures/grid/cell_counts.h"
#include "structures/leaves/triangle_overlap.h"

namespace arboretum::grid {

/// A level's geometry in double, as cells are filled: face i of an axis lies at lower + i * cell.
class CellGeometry {
 public:
  CellGeometry(const Level& level, double pad) : pad_(pad) {
    for (std::size_t a = 0; a < 3; ++a)
      lower_[a] = level.lower[a], cell_[a] = level.cell[a], last_[a] = level.cells_on(int(a)) - 1;
  }

  /// Calls emit(cell number within the level) for each cell that the triangle touches when the cell is
  /// widened by the pad.
  template <class Emit>
  void for_each_touched(const std::array<Vec3f, 3>& corners, Emit&& emit) const {
    Index3 low, high;
    int long_axes = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const float lower = std::min({corners[0][a], corners[1][a], corners[2][a]}),
                  upper = std::max({corners[0][a], corners[1][a], corners[2][a]});
      low[a] = index((lower - pad_ - lower_[a]) / cell_[a], a),
      high[a] = index((upper + pad_ - lower_[a]) / cell_[a], a);
      long_axes += low[a] != high[a];
    }
    if (long_axes < 2) {  // the triangle is connected, so it touches every cell of the row
      for_each(low, high, emit);
    } else {
      split(TriangleOverlap(corners), low, high, emit);
    }
  }

 private:
  [[nodiscard]] std::uint32_t index(double at, std::size_t axis) const {
    return std::uint32_t(std::clamp(at, 0.0, double(last_[axis])));
  }
  [[nodiscard]] std::uint32_t number(std::uint32_t x, std::uint32_t y, std::uint32_t z) const {
    return x + (last_[0] + 1) * (y + (last_[1] + 1) * z);
  }

  template <class Emit>
  void for_each(const Index3& low, const Index3& high, Emit& emit) const {
    for (std::uint32_t z = low[2]; z <= high[2]; ++z)
      for (std::uint32_t y = low[1]; y <= high[1]; ++y)
        for (std::uint32_t x = low[0]; x <= high[0]; ++x) emit(number(x, y, z));
  }

  /// Halves the block of cells along its most cells, and leaves out halves that the triangle does not touch.
  template <class Emit>
  void split(const TriangleOverlap& triangle, const Index3& low, const Index3& high, Emit& emit) const {
    std::array<double, 3> center, half;
    std::size_t axis = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const double width = cell_[a] * (high[a] - low[a] + 1);
      center[a] = lower_[a] + cell_[a] * low[a] + 0.5 * width, half[a] = 0.5 * width + pad_;
      if (high[a] - low[a] > high[axis] - low[axis]) axis = a;
    }
    if (!triangle.touches(center, half)) return;
    if (low == high) return emit(number(low[0], low[1], low[2]));
    Index3 middle = high, after = low;
    middle[axis] = (low[axis] + high[axis]) / 2, after[axis] = middle[axis] + 1;
    split(triangle, low, middle, emit), split(triangle, after, high, emit);
  }

  std::array<double, 3> lower_{}, cell_{};
  std::array<std::uint32_t, 3> last_{};
  double pad_;
};

}  // namespace arboretum::grid
