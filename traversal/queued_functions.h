// From many rays in flight to the functions and rows of the kernel table: how many are in flight, and the counting
// pass.
//
// Queue<Leaves, Padded, AnyHit> has a constructor (const Accel&, const KernelRow&, RayBatch, unsigned in_flight) and
// run(report, counting), which reports each ray's index and nearest hit and counts the lengths of its queues
// (traversal/counting.h).
#pragma once

#include "traversal/kernel_rows.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Rays in flight at most.
inline constexpr unsigned kMostInFlight = TraversalSettings::kMostInFlight;

/// Entries from one ray's stack to the next: an odd number of cache lines where entries fill lines, and nearly so where
/// they do not, so that stacks do not share sets of the cache.
template <class Entry>
[[nodiscard]] constexpr std::size_t stride_of(std::size_t entries) {
  static_assert(sizeof(Entry) <= 64);
  constexpr std::size_t line = 64 / sizeof(Entry);
  return ((entries + line - 1) / line | 1) * line;
}

/// Queue is of closest hit.
template <class Queue, class Counting>
void queued_closest_hit(const Accel& accel, const KernelRow& row, RayBatch rays, unsigned in_flight,
                        std::span<Hit> hits, Counters* counters) {
  Queue queue(accel, row, rays, in_flight);
  queue.run([&](std::size_t i, const NearestHit& best) { hits[i] = to_hit(best); }, Counting(counters));
}

/// Queue is of any hit.
template <class Queue, class Counting>
void queued_any_hit(const Accel& accel, const KernelRow& row, RayBatch rays, unsigned in_flight,
                    std::span<std::uint8_t> occluded, Counters* counters) {
  Queue queue(accel, row, rays, in_flight);
  queue.run([&](std::size_t i, const NearestHit& best) { occluded[i] = best.primitive != NearestHit::kNone; },
            Counting(counters));
}

/// `Closest` and `Any` rays in flight for the two kinds of query, or as many as the batch sets where it `Chooses`. A
/// ray visits the same nodes and leaves in the same order as alone, so the counting functions of `Single` count those.
template <template <class, bool, bool> class Queue, class Single, unsigned Closest, unsigned Any = Closest,
          bool Chooses = false>
struct QueuedFunctions {
  /// How many rays are in flight is all that the rows differ in: the loops are compiled once.
  template <class Leaves, bool Padded>
  static RowFunctions timed() {
    return {[](const Accel& accel, const KernelRow& row, RayBatch rays, std::span<Hit> hits, Counters*) {
              queued_closest_hit<Queue<Leaves, Padded, false>, NoCounters>(accel, row, rays, in_flight(rays, Closest),
                                                                           hits, nullptr);
            },
            [](const Accel& accel, const KernelRow& row, RayBatch rays, std::span<std::uint8_t> occluded, Counters*) {
              queued_any_hit<Queue<Leaves, Padded, true>, NoCounters>(accel, row, rays, in_flight(rays, Any), occluded,
                                                                      nullptr);
            }};
  }
  template <bool Padded>
  static RowFunctions counting() {
    return {[](const Accel& accel, const KernelRow& row, RayBatch rays, std::span<Hit> hits, Counters* counters) {
              Single::template counting<Padded>().closest_hit(accel, row, rays, hits, counters);
              counters->rays_in_flight += rays.size();
              queued_closest_hit<Queue<CalledLeaves, Padded, false>, WithCounters>(
                  accel, row, rays, in_flight(rays, Closest), hits, counters);
            },
            [](const Accel& accel, const KernelRow& row, RayBatch rays, std::span<std::uint8_t> occluded,
               Counters* counters) {
              Single::template counting<Padded>().any_hit(accel, row, rays, occluded, counters);
              counters->rays_in_flight += rays.size();
              queued_any_hit<Queue<CalledLeaves, Padded, true>, WithCounters>(accel, row, rays, in_flight(rays, Any),
                                                                              occluded, counters);
            }};
  }

 private:
  static unsigned in_flight(const RayBatch& rays, unsigned own) {
    return Chooses ? std::clamp(TraversalSettings::chosen(rays.settings.rays_in_flight, own), 1u, kMostInFlight) : own;
  }
};

/// With the numbers of rays in flight that paid most (docs/performance.md), or as many as the batch sets where it
/// `Chooses`.
template <template <class, bool, bool> class Queue, class Single, bool Chooses = false>
using UsualQueuedFunctions = QueuedFunctions<Queue, Single, 32, 64, Chooses>;

/// `queued`, of which a batch may set how many rays are in flight, and rows with fixed numbers.
template <class Structure, template <class, bool, bool> class Queue, class Single, class... Compiled>
void add_queued_rows(KernelRows& rows, TypeList<Compiled...> leaves) {
  add_rows<Structure, UsualQueuedFunctions<Queue, Single, true>>(rows, "queued", leaves);
  add_rows<Structure, QueuedFunctions<Queue, Single, 8>>(rows, "queued8", leaves);
  add_rows<Structure, QueuedFunctions<Queue, Single, 16>>(rows, "queued16", leaves);
  add_rows<Structure, QueuedFunctions<Queue, Single, 32>>(rows, "queued32", leaves);
  add_rows<Structure, QueuedFunctions<Queue, Single, 64>>(rows, "queued64", leaves);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
