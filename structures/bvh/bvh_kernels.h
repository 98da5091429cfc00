// The kernels of the wide BVHs: their ways of traversal on this instruction set.
#pragma once

#include "traversal/usual_leaves.h"
#include "structures/bvh/bvh_ize_single.h"
#include "structures/bvh/bvh_packet.h"
#include "structures/bvh/bvh_queued.h"
#include "structures/bvh/bvh_single.h"
#include "structures/bvh/bvh_stream.h"
#include "structures/bvh/bvh_stream_lists.h"
#include "structures/bvh/bvh_streams_or_queue.h"
#include "traversal/auto_rows.h"
#include "traversal/kernel_rows.h"
#include "traversal/packet_rows.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <int N>
void add_kernels(std::type_identity<bvh::Bvh<N>>, KernelRows& rows) {
  using Single = typename BvhSingle<SoaTests<N>::template Nodes>::Functions;
  add_rows<bvh::Bvh<N>, Single>(rows, "single", UsualLeaves{});
  add_ize_rows<N>(rows);
  add_queued_rows<bvh::Bvh<N>, BvhQueue<N>::template Of, typename BvhQueue<N>::Single>(rows, BatchLeaves{});
  add_packet_rows<bvh::Bvh<N>, BvhPacketFamily<SoaPacketNodes<N>>>(rows, BatchLeaves{});
  using Incoherent = IncoherentInStreams<SoaPacketNodes<N>, BvhQueue<N>::template Of, typename BvhQueue<N>::Single>;
  add_rows<bvh::Bvh<N>,
           AutoFunctions<BvhPacketFamily<SoaPacketNodes<N>>, BatchLeaves, kBesideStreams, Incoherent, Single>>(
      rows, "auto", BatchLeaves{});
  add_stream_rows<bvh::Bvh<N>, SoaPacketNodes<N>>(rows);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
