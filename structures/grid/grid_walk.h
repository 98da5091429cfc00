// One ray through the cells of a grid: 3-D DDA (Amanatides and Woo 1987) with the three axes in lanes.
//
// The distances at which the ray leaves its cell on each axis are `exits`: far - rest * per_cell, where `far`
// is the distance of the grid's last face on that axis and `rest` the number of cells still before it, so
// that nothing accumulates (grid.h has the proof). Those of the next cells are computed before it is known which axes
// step. Axes that leave at the same distance are stepped together.
// An axis along which the ray does not move has far = infinity; lane 3 has FLT_MAX and no cells before it,
// which ends the walk where all else is infinite.
#pragma once

#include "intersectors/leaf_block.h"
#include "simd/swizzle.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// What the walks of one ray share.
struct GridRay {
  using F = vf<4>;
  F origin, direction, reciprocal;
  vm<4> fixed;     ///< axes that the ray does not move along (less than 2^-60 of the largest), and lane 3
  vm<4> negative;  ///< by the sign bit: -0 goes with the negative directions

  /// `reversed`: the same points, at distances of the other sign.
  ARBORETUM_INLINE GridRay(const Ray& ray, bool reversed)
      : origin(F::load(&ray.origin)), direction(F::load(&ray.direction)), reciprocal(0.0f), fixed(false),
        negative(false) {
    if (reversed) direction = -direction;
    const F size = abs(direction);
    fixed = (size <= F(largest_component(ray.direction) * 0x1p-60f)) | vm<4>::from_bits(8);
    negative = direction.as_int() < vi<4>(0);
    reciprocal = F(1.0f) / xyzx(direction);
  }
};

/// A ray's position in one grid. `Within` the cell of an outer one, it is there until it leaves that cell: it has no
/// exit from the last cells of an axis, whose face is the outer cell's. The two are rounded apart, and a ray that
/// hardly moves across them is between them for long.
template <bool Within>
struct GridWalk {
  using F = vf<4>;
  F far, per_cell, rest, exits;
  std::uint32_t cell;      ///< number among all cells
  std::int32_t stride[8];  ///< to the next cell, by the axes that step

  /// The interval of t within the level's box; empty where near > far.
  static ARBORETUM_INLINE void clip(const grid::Level& level, const GridRay& ray, float& near, float& far) {
    const F lower = F::load(level.lower) - ray.origin;
    const F upper = madd(last_of(level) + F(1.0f), F::load(level.cell), F::load(level.lower)) - ray.origin;
    const F infinity(std::numeric_limits<float>::infinity());
    const F a = lower * ray.reciprocal, b = upper * ray.reciprocal;
    F enter = select(ray.negative, b, a), leave = select(ray.negative, a, b);
    const vm<4> outside = ray.fixed & ((lower > F(0.0f)) | (upper < F(0.0f))) & vm<4>::from_bits(7);
    enter = select(ray.fixed, select(outside, infinity, -infinity), enter), leave = select(ray.fixed, infinity, leave);
    near = reduce_max(max_x86(enter, F(near))), far = reduce_min(min_x86(leave, F(far)));
  }

  /// The cell in which the ray is at distance t, the nearest one where it is outside.
  ARBORETUM_INLINE GridWalk(const grid::Level& level, const GridRay& ray, float t) {
    const F lower = F::load(level.lower) - ray.origin, size = F::load(level.cell), most = last_of(level);
    const F upper = madd(most + F(1.0f), size, F::load(level.lower)) - ray.origin;
    const F at = msub(F(t), ray.direction, lower) * F::load(level.inverse);
    const vi<4> index = truncate_to_int(min_x86(max_x86(at, F(0.0f)), most));
    const F i = to_float(index);
    const F infinity(std::numeric_limits<float>::infinity());
    far = select(ray.fixed, select(vm<4>::from_bits(8), F(std::numeric_limits<float>::max()), infinity),
                 select(ray.negative, lower, upper) * ray.reciprocal);
    per_cell = select(ray.fixed, F(0.0f), abs(size * ray.reciprocal));
    rest = select(ray.negative, i, most - i), exits = exits_after(rest);
    const auto row = std::int32_t(level.cells_on(0)), layer = row * std::int32_t(level.cells_on(1));
    std::int32_t k[4];
    index.store(k);
    cell = level.first + std::uint32_t(k[0] + row * k[1] + layer * k[2]);
    const unsigned back = ray.negative.bits();
    const std::int32_t x = back & 1 ? -1 : 1, y = back & 2 ? -row : row, z = back & 4 ? -layer : layer;
    stride[0] = 0, stride[1] = x, stride[2] = y, stride[3] = x + y;
    stride[4] = z, stride[5] = x + z, stride[6] = y + z, stride[7] = x + y + z;
  }

  /// Where the ray leaves the cell, and the axes on which it does.
  ARBORETUM_INLINE float exit(vm<4>& axes) const {
    const float t = reduce_min(exits);
    axes = exits <= F(t);
    return t;
  }

  /// To the next cell; false where that is outside the grid, and where no axis steps (distances that are
  /// NaN).
  ARBORETUM_INLINE bool step(vm<4> axes) {
    const unsigned bits = axes.bits();
    const F less = rest - F(1.0f);
    exits = select(axes, exits_after(less), exits), rest = select(axes, less, rest);
    if ((bits == 0) | ((rest < F(0.0f)).bits() != 0)) return false;
    cell += std::uint32_t(stride[bits & 7]);
    return true;
  }

 private:
  /// Where cells with so many cells behind them are left.
  ARBORETUM_INLINE F exits_after(F cells) const {
    const F t = nmadd(cells, per_cell, far);
    if constexpr (Within) {
      return select(cells > F(0.0f), t, F(std::numeric_limits<float>::infinity()));
    } else {
      return t;
    }
  }

  static ARBORETUM_INLINE F last_of(const grid::Level& level) {
    alignas(16) static constexpr std::int32_t lanes[4] = {-1, -1, -1, 0};
    return F::from_int_bits(vi<4>::load(level.last) & vi<4>::load(lanes));
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
