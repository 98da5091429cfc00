// `auto`: looks at a batch's rays, tile by tile, and hands runs of like tiles to the way of traversal that suits them.
//
// Tiles that are coherent (traversal/auto_tiles.h) go as packets, whose interval test then decides for most rays at
// once; the others go as the structure's best way for rays that share little: the wide BVHs' streams, whose rays share
// nodes as long as they can and hide each other's latency after that (on SSE rays in flight where they share too
// little, structures/bvh/bvh_streams_or_queue.h); elsewhere rays in flight, small packets or single rays. In structures
// of small steps (kd-tree, octree, bounding interval hierarchy) and over instances packets are often worth while for
// rays that only start near each other, too. Whether they are depends on the scene as well: where triangles are small,
// rays that are close together meet different ones. So packets that let too many of their rays go on alone hand the
// tiles that follow to the other way, for a while (`AutoLimits`). What a mode costs for the wrong rays is in
// docs/performance.md. Every way gives the same hits, so the choice changes no answer.
#pragma once

#include "traversal/auto_tiles.h"
#include "traversal/packet_rows.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Packets lose to the other way where a thousand of their rays go on alone more often than this: rays that are
/// coherent; those that only start near each other, asked for the closest or for any hit.
struct AutoLimits {
  static constexpr unsigned kNone = std::numeric_limits<unsigned>::max();
  unsigned coherent = kNone, near_closest = kNone, near_any = kNone;

  /// Scalar kernels are the reference, not a race: none for them.
  static constexpr unsigned on(unsigned sse, unsigned wider) {
    return kRegisterWidth == 1 ? kNone : (kRegisterWidth == 4 ? sse : wider);
  }
};
/// Where the other way is streams, of which SSE has less.
inline constexpr AutoLimits kBesideStreams{.coherent = AutoLimits::on(150, 100)};

/// `Family` as in traversal/packet_rows.h; `CompiledPackets`: a TypeList of the leaves that its packets have compiled
/// in. `Incoherent` and `Alone` (traversal/kernel_rows.h): the other way, and the one for batches of a few rays.
template <class Family, class CompiledPackets, AutoLimits Limits, class Incoherent, class Alone>
struct AutoFunctions {
  using Tiles = AutoTiles<Family>;
  using Kind = typename Tiles::Kind;
  static constexpr std::size_t kTile = Tiles::kTile, kFew = Tiles::kFew;
  /// So many rays in packets show how those do: at first, and at most while they do well. Where too many go on
  /// alone, the next rays take the other way, at first so many, each time twice as many, and so many at most
  /// (docs/performance.md).
  static constexpr std::size_t kProbe = 4 * kTile, kMostPackets = 4 * kProbe, kFirstOther = 8 * kProbe,
                               kMostOther = 64 * kProbe;
  /// Runs of tiles below that are too few for streams.
  static constexpr std::size_t kShort = 96;

  /// Calls packets(begin, count), which returns how often a ray went on alone, and other(begin, count) for runs of
  /// tiles.
  template <class Packets, class Other>
  static void runs(RayBatch rays, bool any_hit, const Packets& packets, const Other& other) {
    // Of the rays before `begin` the last `waiting` are still to go the other way: together with what follows.
    std::size_t begin = 0, waiting = 0;
    const auto send_waiting = [&] {
      if (waiting != 0) other(begin - waiting, waiting);
      waiting = 0;
    };
    struct Trial {
      unsigned limit;
      std::size_t other_way = 0, next_other = kFirstOther, next_packets = kProbe;
    } coherent{Limits.coherent}, near{any_hit ? Limits.near_any : Limits.near_closest};
    const auto run = [&](std::size_t end, Kind kind) {
      Trial& trial = kind == Kind::near ? near : coherent;
      while (begin < end) {
        std::size_t count = end - begin;
        if (kind == Kind::apart) {
          waiting += count;
        } else if (trial.other_way != 0) {
          count = std::min(count, trial.other_way);
          waiting += count, trial.other_way -= count;
        } else {
          send_waiting();
          const std::size_t most = std::min(count, trial.next_packets);
          // What is in doubt goes packet by packet: they end as soon as too many of their rays went on alone.
          const std::size_t step = trial.next_packets == kProbe ? kTile : most;
          std::size_t alone = 0;
          count = 0;
          while (count < most && alone * 1000 <= most * trial.limit) {
            const std::size_t some = std::min(step, most - count);
            alone += packets(begin + count, some), count += some;
          }
          if (alone * 1000 > most * trial.limit) {
            trial.other_way = trial.next_other;
            trial.next_other = std::min(2 * trial.next_other, kMostOther), trial.next_packets = kProbe;
          } else {
            trial.next_other = kFirstOther, trial.next_packets = std::min(2 * trial.next_packets, kMostPackets);
          }
        }
        begin += count;
      }
    };
    Tiles::for_each_run(rays, any_hit ? Tiles::kAnyHitCone : Tiles::kCone, run);
    send_waiting();
  }

  template <class Packets, RowFunctions (*Other)(), RowFunctions (*Few)()>
  struct Batch {
    static void closest_hit(const Accel& accel, const KernelRow& row, RayBatch rays, std::span<Hit> hits,
                            Counters* counters) {
      if (rays.size() < kFew) return Few().closest_hit(accel, row, rays, hits, counters);
      runs(
          rays, false,
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
          rays, true,
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
