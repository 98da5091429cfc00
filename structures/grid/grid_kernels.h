// The kernels of the grid: one ray through one level of cells or two. Closest hit walks front to back, any hit from the
// ray's end to its origin, as a closest hit would walk the reversed ray, since what a shadow ray meets stands by its
// light more often than by its origin (docs/performance/other-structures.md).
#pragma once

#include "structures/bvh/bvh.h"
#include "structures/grid/grid_far_single.h"
#include "structures/grid/grid_walk.h"
#include "structures/leaves/leaf_kernels.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <bool Padded, class Counting>
struct GridSingle {
  using Scratch = NoScratch;
  /// True where any hit is found.
  template <bool AnyHit, class Visits>
  static ARBORETUM_INLINE bool trace(const grid::Grid& grid, const Ray& ray, NearestHit& best, const Counting& counting,
                                     Scratch&, Visits& visits) {
    if constexpr (Padded) {
      if (__builtin_expect(!within_walk_bounds(grid, ray), 0)) return far(grid, ray, best, visits);
    }
    const grid::Level& outer = grid.levels()[0];
    const GridRay lanes(ray, AnyHit);
    // Of the reversed ray where any hit is asked for.
    const float last_t = -ray.tnear;
    float t = AnyHit ? -best.t : ray.tnear, end = AnyHit ? last_t : best.t;
    const auto ends_before = [&](float leave) { return (AnyHit ? last_t : best.t) < leave; };
    GridWalk::clip(outer, lanes, t, end);
    if (!(t <= end)) return false;
    const LeafCode* const codes = grid.codes();
    LeafCode last = kEmptyLeaf;
    GridWalk walk(outer, lanes, t);
    count_grid(counting);
    for (;;) {
      const LeafCode code = codes[walk.cell];
      vm<4> axes;
      const float leave = walk.exit(axes);
      count_cell(counting, code);
      if (code != kEmptyLeaf) {
        if ((code & kLeafCountMask) == kNoLeaf) {
          count_grid(counting);
          GridWalk inner(grid.levels()[code >> kLeafShift], lanes, t);
          for (;;) {
            const LeafCode inside = codes[inner.cell];
            vm<4> inner_axes;
            const float inner_leave = inner.exit(inner_axes);
            count_cell(counting, inside);
            if (inside != kEmptyLeaf && inside != last) {
              last = inside;
              if (visits(inside)) return true;
            }
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

 private:
  template <class Visits>
  static __attribute__((noinline)) bool far(const grid::Grid& grid, const Ray& ray, const NearestHit& best,
                                            Visits& visits) {
    auto leaf = [&](LeafCode code) { return visits(code); };
    return FarWalk(grid, ray, grid.max_coordinate(), best.t, leaf).search(grid.levels()[0]);
  }
  static ARBORETUM_INLINE void count_grid(const Counting& counting) {
    if constexpr (Counting::kCounting) ++counting.counters.nodes;
  }
  static ARBORETUM_INLINE void count_cell(const Counting& counting, LeafCode code) {
    if constexpr (Counting::kCounting) {
      ++counting.counters.boxes, ++counting.counters.lanes, ++counting.counters.lanes_active;
      counting.counters.boxes_hit += code != kEmptyLeaf;
    }
  }
};

inline void add_kernels(std::type_identity<grid::Grid>, KernelRows& rows) {
  ListedLeaves<grid::Grid, GridSingle>::add(rows);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
