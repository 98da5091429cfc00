// The kd-tree's packets as rows of the kernel table: packet4 to packet64, hybrid4 to hybrid16.
#pragma once

#include "structures/kdtree/kdtree_packet.h"
#include "traversal/kernel_rows.h"
#include "traversal/usual_leaves.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// A batch as packets of `rays_each` rays that follow each other.
template <class Leaves, class Counting>
struct KdPacketBatch {
  static constexpr int W = kRegisterWidth < 4 ? 4 : kRegisterWidth;

  static __attribute__((noinline)) void closest_hit(const Accel& accel, const KernelRow& row, RayBatch rays, std::span<Hit> hits, Counters* counters, int rays_each, int threshold) {
    packets<false>(accel, row, rays, counters, rays_each, threshold, [&](std::size_t i, const NearestHit& best) { hits[i] = to_hit(best); });
  }
  static __attribute__((noinline)) void any_hit(const Accel& accel, const KernelRow& row, RayBatch rays, std::span<std::uint8_t> occluded, Counters* counters, int rays_each,
                                                int threshold) {
    packets<true>(accel, row, rays, counters, rays_each, threshold, [&](std::size_t i, const NearestHit& best) { occluded[i] = best.primitive != NearestHit::kNone; });
  }

 private:
  template <bool AnyHit, class Report>
  static ARBORETUM_INLINE void packets(const Accel& accel, const KernelRow& row, RayBatch rays, Counters* counters, int rays_each, int threshold, const Report& report) {
    KdPackets<W, Leaves, AnyHit, Counting> packet(accel, row, Counting(counters));
    for (std::size_t begin = 0; begin < rays.size(); begin += std::size_t(rays_each)) {
      const int count = int(std::min(std::size_t(rays_each), rays.size() - begin));
      packet.trace(&rays[begin], count, threshold);
      for (int i = 0; i < count; ++i) report(begin + std::size_t(i), packet.best(i));
    }
    if constexpr (Counting::kCounting) counters->rays += rays.size(), counters->rays_in_packets += rays.size();
  }
};

/// Packets of `Rays` rays; with no more than `Threshold` of them in a node they go on alone. Of `Hybrid` ones the batch may set it.
template <int Rays, int Threshold, bool Hybrid = false>
struct KdPacketFunctions {
  template <class Batch>
  static RowFunctions functions() {
    return {[](const Accel& a, const KernelRow& row, RayBatch rays, std::span<Hit> hits, Counters* c) { Batch::closest_hit(a, row, rays, hits, c, Rays, threshold(rays)); },
            [](const Accel& a, const KernelRow& row, RayBatch rays, std::span<std::uint8_t> occluded, Counters* c) { Batch::any_hit(a, row, rays, occluded, c, Rays, threshold(rays)); }};
  }
  static int threshold(const RayBatch& rays) {
    return Hybrid ? int(std::min(TraversalSettings::chosen(rays.settings.hybrid_threshold, Threshold), unsigned(Rays))) : Threshold;
  }
  template <class Leaves, bool>
  static RowFunctions timed() {
    return functions<KdPacketBatch<Leaves, NoCounters>>();
  }
  template <bool>
  static RowFunctions counting() {
    return functions<KdPacketBatch<CalledLeaves, WithCounters>>();
  }
};

/// What the wider packets have compiled in: one leaf, since each costs a unit seconds to compile.
using KdPacketLeaves = std::conditional_t<
    kRegisterWidth == 1, TypeList<>,
    std::conditional_t<kRegisterWidth == 4, TypeList<CompiledLeaves<EdgeBlock<4>, MollerTrumbore>>, TypeList<CompiledLeaves<EdgeBlock<8>, MollerTrumbore>>>>;

inline void add_kd_packet_rows(KernelRows& rows) {
  using Tree = kdtree::KdTree;
  add_rows<Tree, KdPacketFunctions<4, 0>>(rows, "packet4", TypeList<>{});
  add_rows<Tree, KdPacketFunctions<8, 0>>(rows, "packet8", TypeList<>{});
  add_rows<Tree, KdPacketFunctions<16, 0>>(rows, "packet16", TypeList<>{});
  add_rows<Tree, KdPacketFunctions<32, 4>>(rows, "packet32", KdPacketLeaves{});
  add_rows<Tree, KdPacketFunctions<64, 6>>(rows, "packet64", KdPacketLeaves{});
  add_rows<Tree, KdPacketFunctions<4, 1, true>>(rows, "hybrid4", TypeList<>{});
  add_rows<Tree, KdPacketFunctions<8, 2, true>>(rows, "hybrid8", TypeList<>{});
  add_rows<Tree, KdPacketFunctions<16, 3, true>>(rows, "hybrid16", TypeList<>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
