// The kernels of the octree: its ways of traversal on this instruction set.
#pragma once

#include "structures/leaves/leaf_kernels.h"
#include "structures/octree/octree_packet.h"
#include "structures/octree/octree_queued.h"
#include "structures/octree/octree_single.h"
#include "traversal/auto_rows.h"
#include "traversal/packet_rows.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <bool Padded, class Counting>
struct OctreeSingle {
  using Scratch = NoScratch;

  template <bool AnyHit, class Visits>
  static ARBORETUM_INLINE bool trace(const octree::Octree& tree, const Ray& ray, NearestHit& best,
                                     const Counting& counting, Scratch&, Visits& visits) {
    const OctreeRay box(BoxRay<8, Padded>(ray, tree.max_coordinate()));
    LeafCode last = kEmptyLeaf;
    return search_octree<AnyHit>(tree, box, {{0, 0, 0, 0}, tree.nodes()[0], 0}, ray.tnear, best, last, counting,
                                 visits);
  }
};

using OctreePacketFamily = PacketFamily<octree::Octree, OctreePackets, true>;

inline void add_kernels(std::type_identity<octree::Octree>, KernelRows& rows) {
  using Single = ListedLeaves<octree::Octree, OctreeSingle>;
  Single::add(rows);
  add_queued_rows<octree::Octree, OctreeQueued, Single::Functions>(rows, TypeList<>{});
  add_packet_rows<octree::Octree, OctreePacketFamily>(rows, TypeList<>{});
  using Incoherent =
      std::conditional_t<kRegisterWidth == 1, Single::Functions, UsualQueuedFunctions<OctreeQueued, Single::Functions>>;
  constexpr AutoLimits limits{.near_closest = AutoLimits::on(2800, 3000),
                              .near_any = AutoLimits::on(2500, AutoLimits::kNone)};
  add_rows<octree::Octree, AutoFunctions<OctreePacketFamily, TypeList<>, limits, Incoherent, Single::Functions>>(
      rows, "auto", TypeList<>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
