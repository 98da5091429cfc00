// `auto`: looks at a batch's rays, tile by tile, and hands runs of like tiles to the way of traversal that suits them.
//
// A tile of 64 rays is coherent when a sample of its rays leaves no wide cone: their directions lie close together. Such tiles go as packets,
// whose interval test then decides for most rays at once; the others are independent rays, for which rays in flight hide each other's
// latency. What a mode costs for the wrong rays is in docs/performance.md. Every way gives the same hits, so the choice changes no answer.
#pragma once

#include "structures/bvh/bvh_packet_rows.h"
#include "structures/bvh/bvh_queued.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <int N>
struct BvhAuto {
  static constexpr std::size_t kTile = 64;
  /// Of the directions' own length, the half extent of those that still count as coherent.
  static constexpr float kCone = 0.25f;
  using Packets = BvhPacketFunctions<SoaPacketNodes<N>, 64, 6>;
  /// Rays in flight pay where children are pushed in registers (docs/performance.md).
  static constexpr bool kQueues = ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512 ? N >= 4 : ARBORETUM_TARGET == ARBORETUM_TARGET_AVX2 && N == 8;
  using Incoherent = std::conditional_t<kQueues, QueuedFunctions<BvhQueue<N>::template Of, typename BvhQueue<N>::Single, 32, 64>, typename BvhQueue<N>::Single>;

  [[nodiscard]] static bool coherent(const Ray* rays, std::size_t count) {
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
    return std::max({half[0], half[1], half[2]}) <= 2.0f * kCone * largest;
  }

  /// Calls run(begin, count, whether coherent) for runs of tiles.
  template <class Run>
  static void runs(RayBatch rays, const Run& run) {
    std::size_t begin = 0;
    bool last = false;
    for (std::size_t at = 0; at < rays.size(); at += kTile) {
      const bool now = coherent(&rays[at], std::min(kTile, rays.size() - at));
      if (now != last) {
        if (at > begin) run(begin, at - begin, last);
        begin = at, last = now;
      }
    }
    if (rays.size() > begin) run(begin, rays.size() - begin, last);
  }

  template <RowFunctions (*Coherent)(), RowFunctions (*Other)()>
  struct Batch {
    static void closest_hit(const Accel& accel, const KernelRow& row, RayBatch rays, std::span<Hit> hits, Counters* counters) {
      runs(rays, [&](std::size_t begin, std::size_t count, bool together) {
        (together ? Coherent() : Other()).closest_hit(accel, row, rays.part(begin, count), hits.subspan(begin, count), counters);
      });
    }
    static void any_hit(const Accel& accel, const KernelRow& row, RayBatch rays, std::span<std::uint8_t> occluded, Counters* counters) {
      runs(rays, [&](std::size_t begin, std::size_t count, bool together) {
        (together ? Coherent() : Other()).any_hit(accel, row, rays.part(begin, count), occluded.subspan(begin, count), counters);
      });
    }
  };

  template <class Leaves, bool Padded>
  static RowFunctions timed() {
    using B = Batch<&Packets::template timed<Leaves, Padded>, &Incoherent::template timed<Leaves, Padded>>;
    return {&B::closest_hit, &B::any_hit};
  }
  template <bool Padded>
  static RowFunctions counting() {
    using B = Batch<&Packets::template counting<Padded>, &Incoherent::template counting<Padded>>;
    return {&B::closest_hit, &B::any_hit};
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
