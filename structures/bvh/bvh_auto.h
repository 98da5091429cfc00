// `auto`: looks at a batch's rays, tile by tile, and hands runs of like tiles to the way of traversal that suits them.
//
// A tile of 64 rays is coherent when a sample of its rays leaves no wide cone: their directions lie close together. Such tiles go as packets,
// whose interval test then decides for most rays at once; the others go as streams, whose rays share nodes as long as they can and hide each other's
// latency after that. Whether packets hold together depends on the scene as well: where triangles are small, rays that are close together meet different ones, and
// packets that let too many of their rays go on alone hand the tiles that follow to streams, for a while. What a mode
// costs for the wrong rays is in docs/performance.md. Every way gives the same hits, so the choice changes no answer.
#pragma once

#include "structures/bvh/bvh_packet_rows.h"
#include "structures/bvh/bvh_stream.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <int N>
struct BvhAuto {
  static constexpr std::size_t kTile = 64;
  /// Of the directions' own length, the half extent of those that still count as coherent. Rays towards a light fan out the more the nearer it is, and
  /// share their end all the same.
  static constexpr float kCone = 0.25f, kAnyHitCone = 0.5f;
  /// So many rays in packets show how those do; where a ray goes on alone more often than this, so many rays take the other way (docs/performance.md).
  static constexpr std::size_t kProbe = 8 * kTile, kOtherWay = 7 * kProbe;
  static constexpr float kTimesAlone = 0.4f;
  /// So many tiles one after the other make a change: streams and packets both begin and end slowly.
  static constexpr unsigned kSwitch = 4;
  static constexpr int kThreshold = 6;  ///< packet64's

  [[nodiscard]] static bool coherent(const Ray* rays, std::size_t count, float cone) {
    if (count < kTile / 4) return false;
    vf<4> low(std::numeric_limits<float>::infinity()), high(-std::numeric_limits<float>::infinity());
    const std::size_t stride = count / 8;
    for (std::size_t i = 0; i < count; i += stride) {
      const vf<4> d = vf<4>::load(&rays[i].direction);
      low = min_x86(low, d), high = max_x86(high, d);
    }
    alignas(16) float half[4], size[4];
    (high - low).store(half), max_x86(abs(low), abs(high)).store(size);
    const float largest = std::max({size[0], size[1], size[2]});
    return std::max({half[0], half[1], half[2]}) <= 2.0f * cone * largest;
  }

  /// Calls packets(begin, count), which returns how often a ray went on alone, and other(begin, count) for runs of tiles.
  template <class Packets, class Other>
  static void runs(RayBatch rays, float cone, const Packets& packets, const Other& other) {
    std::size_t begin = 0, other_way = 0;
    const auto run = [&](std::size_t end, bool together) {
      while (begin < end) {
        std::size_t count = end - begin;
        if (!together) {
          other(begin, count);
        } else if (other_way != 0) {
          count = std::min(count, other_way);
          other(begin, count);
          other_way -= count;
        } else {
          count = std::min(count, kProbe);
          if (float(packets(begin, count)) > kTimesAlone * float(count)) other_way = kOtherWay;
        }
        begin += count;
      }
    };
    bool kind = false;
    unsigned others = 0;  // tiles of the other kind, one after the other
    for (std::size_t at = 0; at < rays.size(); at += kTile) {
      const bool now = coherent(&rays[at], std::min(kTile, rays.size() - at), cone);
      if (at == 0) kind = now;
      others = now == kind ? 0 : others + 1;
      if (others < kSwitch) continue;
      run(at - (kSwitch - 1) * kTile, kind);
      kind = now, others = 0;
    }
    run(rays.size(), kind);
  }

  /// Scalar kernels are the reference, not a race: independent rays go alone.
  using Incoherent = std::conditional_t<kRegisterWidth == 1, typename BvhSingle<SoaTests<N>::template Nodes>::Functions, BvhStream<N>>;
  static constexpr int kNative = kRegisterWidth < 4 ? 4 : kRegisterWidth;

  template <class Packets, RowFunctions (*Other)()>
  struct Batch {
    static void closest_hit(const Accel& accel, const KernelRow& row, RayBatch rays, std::span<Hit> hits, Counters* counters) {
      runs(
          rays, kCone, [&](std::size_t begin, std::size_t count) { return Packets::closest_hit(accel, row, rays.part(begin, count), hits.subspan(begin, count), counters, int(kTile), kThreshold); },
          [&](std::size_t begin, std::size_t count) { Other().closest_hit(accel, row, rays.part(begin, count), hits.subspan(begin, count), counters); });
    }
    static void any_hit(const Accel& accel, const KernelRow& row, RayBatch rays, std::span<std::uint8_t> occluded, Counters* counters) {
      runs(
          rays, kAnyHitCone, [&](std::size_t begin, std::size_t count) { return Packets::any_hit(accel, row, rays.part(begin, count), occluded.subspan(begin, count), counters, int(kTile), kThreshold); },
          [&](std::size_t begin, std::size_t count) { Other().any_hit(accel, row, rays.part(begin, count), occluded.subspan(begin, count), counters); });
    }
  };

  template <class Leaves, bool Padded>
  static RowFunctions timed() {
    using B = Batch<PacketBatch<SoaPacketNodes<N>, kNative, Leaves, NoCounters>, &Incoherent::template timed<Leaves, Padded>>;
    return {&B::closest_hit, &B::any_hit};
  }
  template <bool Padded>
  static RowFunctions counting() {
    using B = Batch<PacketBatch<SoaPacketNodes<N>, kNative, CalledLeaves, WithCounters>, &Incoherent::template counting<Padded>>;
    return {&B::closest_hit, &B::any_hit};
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
