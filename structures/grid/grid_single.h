// One ray through one level of a grid's cells or two. Closest hit walks front to back, any hit from the ray's end to
// its origin, as a closest hit would walk the reversed ray, since what a shadow ray meets stands by its light more
// often than by its origin (docs/performance/other-structures.md).
#pragma once

#include "structures/grid/grid_far_single.h"
#include "structures/grid/grid_walk.h"
#include "traversal/counting.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <class Counting>
ARBORETUM_INLINE void count_level([[maybe_unused]] const Counting& counting) {
  if constexpr (Counting::kCounting) ++counting.counters.nodes;
}
template <class Counting>
ARBORETUM_INLINE void count_cell([[maybe_unused]] const Counting& counting, [[maybe_unused]] LeafCode code) {
  if constexpr (Counting::kCounting) counting.box_tests(1, 1), counting.counters.boxes_hit += code != kEmptyLeaf;
}

/// Where a ray's walk begins; `within`: it has come to the grid before, and is only going on.
struct GridStart {
  float t;
  bool within = false;
};

/// The ray's way through the cells from `from` on, forwards to best.t, or, any hit, backwards to tnear.
/// Calls visits(code) for leaves; true where that was true. `last`: the leaf that the ray comes from: neighbouring
/// cells may share one.
template <bool AnyHit, class Counting, class Visits>
ARBORETUM_INLINE bool walk_grid(const grid::Grid& grid, const Ray& ray, GridStart from, const NearestHit& best,
                                LeafCode& last, const Counting& counting, Visits& visits) {
  const grid::Level& outer = grid.levels()[0];
  const GridRay lanes(ray, AnyHit);
  // Of the reversed ray where any hit is asked for.
  const float last_t = -ray.tnear;
  float t = AnyHit ? -from.t : from.t, end = AnyHit ? last_t : best.t;
  const auto ends_before = [&](float leave) { return (AnyHit ? last_t : best.t) < leave; };
  GridWalk<false>::clip(outer, lanes, t, end);
  if (!(t <= end)) return false;
  const LeafCode* const codes = grid.codes();
  GridWalk<false> walk(outer, lanes, t);
  if (!from.within) count_level(counting);
  for (;;) {
    const LeafCode code = codes[walk.cell];
    vm<4> axes;
    const float leave = walk.exit(axes);
    count_cell(counting, code);
    if (code != kEmptyLeaf) {
      if ((code & kLeafCountMask) == kNoLeaf) {
        count_level(counting);
        GridWalk<true> inner(grid.levels()[code >> kLeafShift], lanes, t);
        for (;;) {
          const LeafCode inside = codes[inner.cell];
          vm<4> inner_axes;
          const float inner_leave = inner.exit(inner_axes);
          count_cell(counting, inside);
          if (inside != kEmptyLeaf && inside != last) {
            last = inside;
            if (visits(inside)) return true;
          }
          if (!(inner_leave < leave)) break;
          if (ends_before(inner_leave)) return false;
          if (!inner.step(inner_axes)) break;
        }
      } else if (code != last) {
        last = code;
        if (visits(code)) return true;
      }
    }
    if (ends_before(leave)) return false;
    if (!walk.step(axes)) return false;
    t = leave;
  }
}

/// The same for a ray outside the walk's bounds, from its start.
template <class Visits>
__attribute__((noinline)) bool walk_far(const grid::Grid& grid, const Ray& ray, const NearestHit& best,
                                        Visits& visits) {
  auto leaf = [&](LeafCode code) { return visits(code); };
  return FarWalk(grid, ray, grid.max_coordinate(), best.t, leaf).search(grid.levels()[0]);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
