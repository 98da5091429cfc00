// The way through a grid's cells for rays that are outside the walk's bounds (grid.h): blocks of cells are
// halved like the nodes of a binary tree, with the padded box test of the bounding volume hierarchies. Slower
// than walking, and right for any ray.
#pragma once

#include "intersectors/leaf_block.h"
#include "structures/bvh/bvh.h"
#include "structures/grid/grid.h"
#include "traversal/box_test.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Calls leaf(code) for the leaves that the padded ray meets, near to far; leaf returns true to end the
/// search. `tfar` is read anew before each cell, so that it may shrink. `max_coordinate`: what boxes are padded for.
template <class Leaf>
class FarWalk {
 public:
  FarWalk(const grid::Grid& grid, const Ray& ray, float max_coordinate, const float& tfar, Leaf& leaf)
      : grid_(grid), box_(BoxRay<2, true>(ray, max_coordinate)), tnear_(ray.tnear), tfar_(tfar), leaf_(leaf) {
    for (int a = 0; a < 3; ++a) negative_[a] = __builtin_signbit(ray.direction[std::size_t(a)]);
  }

  /// The cells low .. high of a level.
  bool search(const grid::Level& level, const std::uint32_t (&low)[3], const std::uint32_t (&high)[3]) const {
    int axis = 0;
    for (int a = 1; a < 3; ++a)
      if (high[a] - low[a] > high[axis] - low[axis]) axis = a;
    if (low[axis] == high[axis]) {
      const LeafCode code =
          grid_.codes()[level.first + low[0] + level.cells_on(0) * (low[1] + level.cells_on(1) * low[2])];
      if (code == kEmptyLeaf) return false;
      if ((code & kLeafCountMask) != kNoLeaf) return leaf_(code);
      return search(grid_.levels()[code >> kLeafShift]);
    }
    std::uint32_t middle[3] = {high[0], high[1], high[2]}, after[3] = {low[0], low[1], low[2]};
    middle[axis] = (low[axis] + high[axis]) / 2, after[axis] = middle[axis] + 1;
    alignas(64) bvh::Node<2> node{};
    for (int a = 0; a < 3; ++a) {
      const auto face = [&](std::uint32_t i) { return grid::face(level, std::size_t(a), i); };
      node.planes[2 * a][0] = face(low[a]), node.planes[2 * a + 1][0] = face(middle[a] + 1);
      node.planes[2 * a][1] = face(after[a]), node.planes[2 * a + 1][1] = face(high[a] + 1);
    }
    vf<4> entry;
    const unsigned hit = box_.test(reinterpret_cast<const std::byte*>(&node), vf<4>(tnear_), vf<4>(tfar_), entry);
    alignas(16) float near[4];
    entry.store(near);
    const bool first_is_after = negative_[axis];
    for (const bool second : {first_is_after, !first_is_after}) {
      if ((hit >> unsigned(second) & 1u) == 0 || near[second] > tfar_) continue;
      if (second ? search(level, after, high) : search(level, low, middle)) return true;
    }
    return false;
  }
  bool search(const grid::Level& level) const {
    return search(level, {0, 0, 0}, {level.cells_on(0) - 1, level.cells_on(1) - 1, level.cells_on(2) - 1});
  }

 private:
  const grid::Grid& grid_;
  BoxLanes<2, true> box_;
  bool negative_[3];
  float tnear_;
  const float& tfar_;
  Leaf& leaf_;
};

/// Whether the walk's proof holds for rays (grid.h), and their numbers are far from overflowing: the reciprocals of
/// components down to 2^-60 of the largest among them. `away`: the largest |component| of the origin as the grid's
/// lower corner sees it; `largest`: that of the direction. `F` is float or lanes.
template <class F>
ARBORETUM_INLINE auto within_walk_bounds(const grid::Grid& grid, F away, F largest) {
  const float all = grid.max_coordinate() + 32.0f * grid.reach();
  const float most_away = all < 0x1p120f ? 16.0f * grid.reach() : -1.0f;
  return (away <= F(most_away)) & (F(0x1p-60f) <= largest) & (F(all) <= F(0x1p60f) * largest) &
         (F(grid.pad()) >= F(0x1p-80f) * largest);
}
ARBORETUM_INLINE bool within_walk_bounds(const grid::Grid& grid, const Ray& ray) {
  const grid::Level& outer = grid.levels()[0];
  float away = 0.0f;
  for (int a = 0; a < 3; ++a) {
    const float o = __builtin_fabsf((&ray.origin.x)[a] - outer.lower[a]);
    away = o > away ? o : away;
  }
  return within_walk_bounds(grid, away, largest_component(ray.direction)) != 0;
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
