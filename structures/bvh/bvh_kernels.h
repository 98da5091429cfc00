// The kernels of the wide BVHs: their ways of traversal on this instruction set.
#pragma once

#include "traversal/usual_leaves.h"
#include "structures/bvh/bvh_auto.h"
#include "structures/bvh/bvh_ize_single.h"
#include "structures/bvh/bvh_packet_rows.h"
#include "structures/bvh/bvh_queued.h"
#include "structures/bvh/bvh_single.h"
#include "structures/bvh/bvh_stream.h"
#include "structures/bvh/bvh_stream_lists.h"
#include "traversal/kernel_rows.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <int N>
void add_kernels(std::type_identity<bvh::Bvh<N>>, KernelRows& rows) {
  add_rows<bvh::Bvh<N>, typename BvhSingle<SoaTests<N>::template Nodes>::Functions>(rows, "single", UsualLeaves{});
  add_ize_rows<N>(rows);
  add_queued_rows<bvh::Bvh<N>, BvhQueue<N>::template Of, typename BvhQueue<N>::Single>(rows, BatchLeaves{});
  add_packet_rows<bvh::Bvh<N>, SoaPacketNodes<N>>(rows, BatchLeaves{});
  add_rows<bvh::Bvh<N>, BvhAuto<N>>(rows, "auto", BatchLeaves{});
  add_stream_rows<N>(rows);
  add_stream_list_rows<N>(rows);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
