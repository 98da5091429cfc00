// The kernels of the bounding interval hierarchy: its ways of traversal on this instruction set.
#pragma once

#include "structures/bih/bih_packet.h"
#include "structures/bih/bih_queued.h"
#include "structures/bih/bih_single.h"
#include "structures/leaves/leaf_kernels.h"
#include "traversal/auto_rows.h"
#include "traversal/packet_rows.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <bool Padded, class Counting>
struct BihSingle {
  using Scratch = IntervalStack;

  template <bool AnyHit, class Visits>
  static ARBORETUM_INLINE bool trace(const bih::Bih& tree, const Ray& ray, NearestHit& best, const Counting& counting,
                                     Scratch& stack, Visits& visits) {
    const IntervalRay interval(BoxRay<2, Padded>(ray, tree.max_coordinate()));
    float low = ray.tnear, high = best.t;
    clip_to_scene(tree, interval, low, high);
    return low <= high &&
           search_bih<AnyHit>(tree, interval, tree.nodes(), low, high, best, counting, stack.data(), visits);
  }
};

using BihPacketFamily = PacketFamily<bih::Bih, BihPackets, true>;

inline void add_kernels(std::type_identity<bih::Bih>, KernelRows& rows) {
  using Single = ListedLeaves<bih::Bih, BihSingle>;
  Single::add(rows);
  add_queued_rows<bih::Bih, BihQueued, Single::Functions>(rows, TypeList<>{});
  add_packet_rows<bih::Bih, BihPacketFamily>(rows, TypeList<>{});
  constexpr AutoLimits limits{.near_any = AutoLimits::on(1000, AutoLimits::kNone)};
  add_rows<bih::Bih, AutoFunctions<BihPacketFamily, TypeList<>, limits, Single::Functions, Single::Functions>>(
      rows, "auto", TypeList<>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
