// The kernels of the kd-tree: its ways of traversal on this instruction set.
#pragma once

#include "traversal/usual_leaves.h"
#include "structures/kdtree/kdtree_packet.h"
#include "structures/kdtree/kdtree_queued.h"
#include "structures/kdtree/kdtree_single.h"
#include "traversal/auto_rows.h"
#include "traversal/kernel_rows.h"
#include "traversal/packet_rows.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

using KdPacketFamily = PacketFamily<kdtree::KdTree, KdPackets, true>;

inline void add_kernels(std::type_identity<kdtree::KdTree>, KernelRows& rows) {
  using Single = SingleRayFunctions<KdKernel>;
  add_rows<kdtree::KdTree, Single>(rows, "single", UsualLeaves{});
  add_queued_rows<kdtree::KdTree, KdQueued, Single>(rows, UsualLeaves{});
  add_packet_rows<kdtree::KdTree, KdPacketFamily>(rows, KdPacketLeaves{});
  using Incoherent = std::conditional_t<kRegisterWidth == 1, Single, UsualQueuedFunctions<KdQueued, Single>>;
  constexpr AutoLimits limits{.near_closest = AutoLimits::on(1600, AutoLimits::kNone),
                              .near_any = AutoLimits::on(1300, 1650)};
  add_rows<kdtree::KdTree, AutoFunctions<KdPacketFamily, KdPacketLeaves, limits, Incoherent, Single>>(rows, "auto",
                                                                                                      UsualLeaves{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
