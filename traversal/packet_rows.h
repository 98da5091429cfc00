// Packets as rows of the kernel table: packet4 to packet64, hybrid4 to hybrid16.
#pragma once

#include "traversal/kernel_rows.h"
#include "traversal/packet_leaves.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Lanes of a register of packets of so many rays. `Family::kFewerLanes`: packets of fewer rays than a register holds
/// have narrower registers.
template <class Family>
constexpr int register_lanes(int rays_each) {
  return Family::kFewerLanes ? std::min(rays_each, kNativeWidth) : kNativeWidth;
}

/// A family as most structures have it: whole registers. `ForNearRays`: `auto` takes packets for rays that only start
/// near each other, too (traversal/auto_tiles.h): within kNear of the extent of all origins.
template <class S, template <int W, class Leaves, bool AnyHit, class Counting> class P, bool ForNearRays>
struct PacketFamily {
  using Structure = S;
  static constexpr bool kFewerLanes = false;
  static constexpr float kNear = ForNearRays ? 0.125f : 0.0f;
  template <int W, class Leaves, bool AnyHit, class Counting>
  using Packets = P<W, Leaves, AnyHit, Counting>;
};

/// A batch as packets of `rays_each` rays that follow each other. Returns how often a ray went on alone.
/// `Family::Packets<W, Leaves, AnyHit, Counting>` is the class for packets of W rays a register through a
/// `Family::Structure`.
template <class Family, int W, class Leaves, class Counting>
struct PacketBatch {
  static __attribute__((noinline)) std::size_t closest_hit(const Accel& accel, const KernelRow& row, RayBatch rays,
                                                           std::span<Hit> hits, Counters* counters, int rays_each,
                                                           int threshold) {
    return packets<false>(accel, row, rays, counters, rays_each, threshold,
                          [&](std::size_t i, const NearestHit& best) { hits[i] = stored_to_hit(best); });
  }
  static __attribute__((noinline)) std::size_t any_hit(const Accel& accel, const KernelRow& row, RayBatch rays,
                                                       std::span<std::uint8_t> occluded, Counters* counters,
                                                       int rays_each, int threshold) {
    return packets<true>(accel, row, rays, counters, rays_each, threshold, [&](std::size_t i, const NearestHit& best) {
      occluded[i] = best.primitive != NearestHit::kNone;
    });
  }

 private:
  template <bool AnyHit, class Report>
  static ARBORETUM_INLINE std::size_t packets(const Accel& accel, const KernelRow& row, RayBatch rays,
                                              Counters* counters, int rays_each, int threshold, const Report& report) {
    typename Family::template Packets<W, Leaves, AnyHit, Counting> packet(
        static_cast<const typename Family::Structure&>(accel), row, Counting(counters));
    if constexpr (Counting::kCounting) packet.set_width(unsigned(register_lanes<Family>(rays_each)));
    if constexpr (requires { packet.set_size(rays_each); }) packet.set_size(rays_each);
    for (std::size_t begin = 0; begin < rays.size(); begin += std::size_t(rays_each)) {
      const std::size_t count = std::min(std::size_t(rays_each), rays.size() - begin);
      packet.trace(rays.part(begin, count), threshold);
      for (std::size_t i = 0; i < count; ++i) report(begin + i, packet.best(int(i)));
    }
    if constexpr (Counting::kCounting) counters->rays += rays.size(), counters->rays_in_packets += rays.size();
    return packet.times_alone();
  }
};

/// Packets of `Rays` rays; with no more than `Threshold` of them in a node they go on alone. Of `Hybrid` ones the batch
/// may set it.
template <class Family, int Rays, int Threshold, bool Hybrid = false>
struct PacketFunctions {
  template <class Batch>
  static RowFunctions functions() {
    return {[](const Accel& a, const KernelRow& row, RayBatch rays, std::span<Hit> hits, Counters* c) {
              Batch::closest_hit(a, row, rays, hits, c, Rays, threshold(rays));
            },
            [](const Accel& a, const KernelRow& row, RayBatch rays, std::span<std::uint8_t> occluded, Counters* c) {
              Batch::any_hit(a, row, rays, occluded, c, Rays, threshold(rays));
            }};
  }
  static int threshold(const RayBatch& rays) {
    return Hybrid ? int(std::min(TraversalSettings::chosen(rays.settings.hybrid_threshold, Threshold), unsigned(Rays)))
                  : Threshold;
  }
  template <class Leaves, bool>
  static RowFunctions timed() {
    return functions<PacketBatch<Family, register_lanes<Family>(Rays), Leaves, NoCounters>>();
  }
  /// What is visited does not depend on the lanes of a register. Triangles that no ray of a packet can hit, which are
  /// left out where leaf tests are compiled in, are counted as if they were tested.
  template <bool>
  static RowFunctions counting() {
    return functions<PacketBatch<Family, kNativeWidth, CalledLeaves, WithCounters>>();
  }
};

/// With no more than so many rays in a node they go on alone: what was fastest (docs/performance/packets.md). Packets
/// of up to 16 rays stay together to the end, which is what tells them from hybrids.
inline constexpr int kFewOf32 = 4, kFewOf64 = 6, kFewOfHybrid4 = 1, kFewOfHybrid8 = 2, kFewOfHybrid16 = 3;

/// The functions of rows as they are.
template <class Functions>
using AsTheyAre = Functions;

/// `Compiled`: what packet32 and packet64 have compiled in. `Of`: what a structure makes of rows' functions.
template <class Structure, class Family, template <class> class Of = AsTheyAre, class Compiled>
void add_packet_rows(KernelRows& rows, Compiled compiled) {
  add_rows<Structure, Of<PacketFunctions<Family, 4, 0>>>(rows, "packet4", TypeList<>{});
  add_rows<Structure, Of<PacketFunctions<Family, 8, 0>>>(rows, "packet8", TypeList<>{});
  add_rows<Structure, Of<PacketFunctions<Family, 16, 0>>>(rows, "packet16", TypeList<>{});
  add_rows<Structure, Of<PacketFunctions<Family, 32, kFewOf32>>>(rows, "packet32", compiled);
  add_rows<Structure, Of<PacketFunctions<Family, 64, kFewOf64>>>(rows, "packet64", compiled);
  add_rows<Structure, Of<PacketFunctions<Family, 4, kFewOfHybrid4, true>>>(rows, "hybrid4", TypeList<>{});
  add_rows<Structure, Of<PacketFunctions<Family, 8, kFewOfHybrid8, true>>>(rows, "hybrid8", TypeList<>{});
  add_rows<Structure, Of<PacketFunctions<Family, 16, kFewOfHybrid16, true>>>(rows, "hybrid16", TypeList<>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
