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
  add_rows<kdtree::KdTree, SingleRayFunctions<KdKernel>>(rows, "single", UsualLeaves{});
  add_queued_rows<kdtree::KdTree, KdQueued, SingleRayFunctions<KdKernel>>(rows, UsualLeaves{});
  add_packet_rows<kdtree::KdTree, KdPacketFamily>(rows, KdPacketLeaves{});
  add_rows<kdtree::KdTree, AutoFunctions<KdPacketFamily, KdPacketLeaves, SingleRayFunctions<KdKernel>>>(rows, "auto",
                                                                                                        UsualLeaves{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
