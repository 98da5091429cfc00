// `auto`: looks at a batch's rays, tile by tile, and hands runs of like tiles to the way of traversal that suits them.
//
// A tile of 64 rays is coherent when a sample of its rays leaves no wide cone: their directions lie close together.
// Such tiles go as packets, whose interval test then decides for most rays at once; the others go as the structure's
// best way for rays that share little: the wide BVHs' streams, whose rays share nodes as long as they can and hide each
// other's latency after that (on SSE rays in flight where they share too little,
// structures/bvh/bvh_streams_or_queue.h); rays in flight or single rays where there are none. In structures of small
// steps (kd-tree, octree, bounding interval hierarchy) packets are worth while for rays that only start near each
// other, too. In the wide BVHs, whether packets are better than streams depends on the scene as well: where triangles
// are small, rays that are close together meet different ones, and packets that let too many of their rays go on alone
// hand the tiles that follow to streams, for a while. What a mode costs for the wrong rays is in docs/performance.md.
// Every way gives the same hits, so the choice changes no answer.
#pragma once

#include "traversal/packet_rows.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// `Family` as in traversal/packet_rows.h; `CompiledPackets`: a TypeList of the leaves that its packets have compiled
/// in. `Incoherent` and `Alone` (traversal/kernel_rows.h): the other way, and the one for batches of a few rays.
/// `MayFallApart`: packets that let too many of their rays go on alone lose to the other way, also where rays are
/// coherent: to streams, not to rays in flight.
template <class Family, class CompiledPackets, class Incoherent, class Alone = Incoherent,
          bool MayFallApart = !std::is_same_v<Incoherent, Alone>>
struct AutoFunctions {
  static constexpr std::size_t kTile = 64;
  /// Of the directions' own length, the half extent of those that still count as coherent. Rays towards a light fan out
  /// the more the nearer it is, and share their end all the same.
  static constexpr float kCone = 0.25f, kAnyHitCone = 0.5f;
  /// Of the extent of all origins of the batch, that of a tile's which start near each other.
  static constexpr float kNear = 0.125f;
  /// So many rays in packets show how those do: at first, and at most while they do well. Where a ray goes on alone
  /// more often than this, the next rays take the other way, at first so many, each time twice as many, and so many at
  /// most (docs/performance.md).
  static constexpr std::size_t kProbe = 4 * kTile, kMostPackets = 4 * kProbe, kFirstOther = 8 * kProbe,
                               kMostOther = 64 * kProbe;
  static constexpr float kTimesAlone = kRegisterWidth == 4 ? 0.15f : 0.1f;  ///< on SSE streams have less to offer
  /// So many tiles one after the other make a change: streams and packets both begin and end slowly.
  static constexpr unsigned kSwitch = 4;
  /// Smaller batches are too few to share anything; runs of tiles below the second too few for streams.
  static constexpr std::size_t kFew = 8, kShort = 96;
  /// Where a ray that would be looked at is not valid (core/ray.h), so many are, from it on: the first valid one
  /// counts.
  static constexpr std::size_t kLook = 8;
  /// Of `count` rays' directions or origins, of which some `samples` are looked at, valid ones alone: the largest
  /// extent along an axis, negative where there is none, and the largest |coordinate|.
  struct Spread {
    float extent, largest;
  };
  [[nodiscard]] static Spread spread(const Ray* rays, std::size_t count, std::size_t samples, Vec3f Ray::*part) {
    vf<4> low(std::numeric_limits<float>::infinity()), high(-std::numeric_limits<float>::infinity());
    const std::size_t step = std::max(count / samples, std::size_t{1});
    for (std::size_t i = 0; i < count; i += step) {
      const std::size_t end = std::min(i + std::min(step, kLook), count);
      std::size_t at = i;
      while (at < end && !is_valid_in_lanes(rays[at])) ++at;
      if (at == end) continue;
      const vf<4> v = vf<4>::load(&(rays[at].*part));
      low = min_x86(low, v), high = max_x86(high, v);
    }
    alignas(16) float extent[4], size[4];
    (high - low).store(extent), max_x86(abs(low), abs(high)).store(size);
    return {std::max({extent[0], extent[1], extent[2]}), std::max({size[0], size[1], size[2]})};
  }

  /// What is for a tile; `any`: no ray of its sample is valid.
  enum class Way { packets, other, any };
  [[nodiscard]] static Way way(const Ray* rays, std::size_t count, float cone, float near) {
    if (count < kFew) return Way::other;
    const Spread directions = spread(rays, count, 8, &Ray::direction);
    if (directions.extent < 0.0f) return Way::any;
    const bool together = directions.extent <= 2.0f * cone * directions.largest ||
                          (Family::kForNearRays && spread(rays, count, 8, &Ray::origin).extent <= near);
    return together ? Way::packets : Way::other;
  }

  /// Calls packets(begin, count), which returns how often a ray went on alone, and other(begin, count) for runs of
  /// tiles.
  template <class Packets, class Other>
  static void runs(RayBatch rays, float cone, const Packets& packets, const Other& other) {
    // Of the rays before `begin` the last `waiting` are still to go the other way: together with what follows.
    std::size_t begin = 0, waiting = 0, other_way = 0, next_other = kFirstOther, next_packets = kProbe;
    const auto send_waiting = [&] {
      if (waiting != 0) other(begin - waiting, waiting);
      waiting = 0;
    };
    const auto run = [&](std::size_t end, Way kind) {
      while (begin < end) {
        std::size_t count = end - begin;
        if (kind == Way::other) {
          waiting += count;
        } else if (other_way != 0) {
          count = std::min(count, other_way);
          waiting += count, other_way -= count;
        } else {
          send_waiting();
          count = std::min(count, next_packets);
          if (float(packets(begin, count)) > kTimesAlone * float(count) && MayFallApart) {
            other_way = next_other;
            next_other = std::min(2 * next_other, kMostOther), next_packets = kProbe;
          } else {
            next_other = kFirstOther, next_packets = std::min(2 * next_packets, kMostPackets);
          }
        }
        begin += count;
      }
    };
    const float near = Family::kForNearRays ? kNear * spread(&rays[0], rays.size(), 64, &Ray::origin).extent : 0.0f;
    Way kind = Way::any;
    std::size_t others = 0, change = 0;  // tiles of the other kind, one after the other, and where they begin
    std::size_t alike = 0, last = 0;     // tiles of `kind`, one after the other, and the last of them
    for (std::size_t at = 0; at < rays.size(); at += kTile) {
      const Way now = way(&rays[at], std::min(kTile, rays.size() - at), cone, near);
      if (now == Way::any) continue;  // goes as the tiles beside it do
      if (kind == Way::any) kind = now;
      if (now == kind) {
        others = 0, last = at;
        // Then one tile in kSwitch is looked at: a change of so many tiles is seen all the same.
        if (++alike >= kSwitch) at += (kSwitch - 1) * kTile;
        continue;
      }
      if (others == 0 && alike >= kSwitch) {  // those that were passed over
        at = last, alike = 0;
        continue;
      }
      alike = 0;
      if (others++ == 0) change = at;
      if (others < kSwitch) continue;
      run(change, kind);
      kind = now, others = 0;
    }
    run(rays.size(), kind);
    send_waiting();
  }

  template <class Packets, RowFunctions (*Other)(), RowFunctions (*Few)()>
  struct Batch {
    static void closest_hit(const Accel& accel, const KernelRow& row, RayBatch rays, std::span<Hit> hits,
                            Counters* counters) {
      if (rays.size() < kFew) return Few().closest_hit(accel, row, rays, hits, counters);
      runs(
          rays, kCone,
          [&](std::size_t begin, std::size_t count) {
            return Packets::closest_hit(accel, row, rays.part(begin, count), hits.subspan(begin, count), counters,
                                        int(kTile), kFewOf64);
          },
          [&](std::size_t begin, std::size_t count) {
            (count < kShort ? Few() : Other())
                .closest_hit(accel, row, rays.part(begin, count), hits.subspan(begin, count), counters);
          });
    }
    static void any_hit(const Accel& accel, const KernelRow& row, RayBatch rays, std::span<std::uint8_t> occluded,
                        Counters* counters) {
      if (rays.size() < kFew) return Few().any_hit(accel, row, rays, occluded, counters);
      runs(
          rays, kAnyHitCone,
          [&](std::size_t begin, std::size_t count) {
            return Packets::any_hit(accel, row, rays.part(begin, count), occluded.subspan(begin, count), counters,
                                    int(kTile), kFewOf64);
          },
          [&](std::size_t begin, std::size_t count) {
            (count < kShort ? Few() : Other())
                .any_hit(accel, row, rays.part(begin, count), occluded.subspan(begin, count), counters);
          });
    }
  };

  template <class Leaves, class... Compiled>
  static constexpr bool holds(TypeList<Compiled...>) {
    return (std::is_same_v<Leaves, Compiled> || ...);
  }

  template <class Leaves, bool Padded>
  static RowFunctions timed() {
    using Packets = std::conditional_t<holds<Leaves>(CompiledPackets{}), Leaves, CalledLeaves>;
    using B = Batch<PacketBatch<Family, kNativeWidth, Packets, NoCounters>, &Incoherent::template timed<Leaves, Padded>,
                    &Alone::template timed<Leaves, Padded>>;
    return {&B::closest_hit, &B::any_hit};
  }
  template <bool Padded>
  static RowFunctions counting() {
    using B = Batch<PacketBatch<Family, kNativeWidth, CalledLeaves, WithCounters>,
                    &Incoherent::template counting<Padded>, &Alone::template counting<Padded>>;
    return {&B::closest_hit, &B::any_hit};
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
