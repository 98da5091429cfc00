// The kernels of the grid: its ways of traversal on this instruction set.
#pragma once

#include "structures/grid/grid_packet.h"
#include "structures/grid/grid_single.h"
#include "structures/leaves/leaf_kernels.h"
#include "traversal/auto_rows.h"
#include "traversal/packet_rows.h"
#include "traversal/usual_leaves.h"

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
      if (__builtin_expect(!within_walk_bounds(grid, ray), 0)) return walk_far(grid, ray, best, visits);
    }
    LeafCode last = kEmptyLeaf;
    return walk_grid<AnyHit>(grid, ray, {AnyHit ? best.t : ray.tnear}, best, last, counting, visits);
  }
};

using GridPacketFamily = PacketFamily<grid::Grid, GridPackets, false>;

inline void add_kernels(std::type_identity<grid::Grid>, KernelRows& rows) {
  using Single = ListedLeaves<grid::Grid, GridSingle>;
  Single::add(rows);
  add_packet_rows<grid::Grid, GridPacketFamily>(rows, BatchLeaves{});
  add_rows<grid::Grid,
           AutoFunctions<GridPacketFamily, BatchLeaves, AutoLimits{}, Single::Functions, Single::Functions>>(
      rows, "auto", BatchLeaves{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
