// How `auto` traces rays that share little where registers are narrow (SSE): as streams as long as their rays share
// nodes and leaves, else as rays in flight.
//
// A stream's turns cost more than a ray's own steps do, and are worth it for what they share. How many rays take a turn
// together tells: where it is three, rays in flight are 1.3 times as fast, where it is five, as fast
// (docs/performance.md). With wider registers streams are faster even then.
#pragma once

#include "structures/bvh/bvh_queued.h"
#include "structures/bvh/bvh_stream.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// `Streams` and `Format`: as StreamFunctions takes them; `Queue` and `Single`: rays in flight
/// (traversal/queued_functions.h).
template <template <class, class, bool, bool, class> class Streams, class Format,
          template <class, bool, bool> class Queue, class Single>
class BvhStreamsOrQueue {
  /// So many rays as a stream show how they share; then so many go the one way or the other until it is asked again,
  /// each time that the answer is the same twice as many, and so many at most.
  static constexpr std::size_t kProbe = 4096, kThen = 8 * kProbe, kMost = 8 * kThen;
  static constexpr float kShared = 4.5f;
  using Queued = UsualQueuedFunctions<Queue, Single>;

 public:
  template <class Leaves, bool Padded>
  static RowFunctions timed() {
    return functions<Leaves, Padded, NoCounters, &Queued::template timed<Leaves, Padded>>();
  }
  template <bool Padded>
  static RowFunctions counting() {
    return functions<CalledLeaves, Padded, WithCounters, &Queued::template counting<Padded>>();
  }

 private:
  template <class Leaves, bool Padded, class Counting, RowFunctions (*InFlight)()>
  static RowFunctions functions() {
    return {
        [](const Accel& a, const KernelRow& row, RayBatch rays, std::span<Hit> hits, Counters* counters) {
          run(
              rays,
              [&](std::size_t begin, std::size_t count) {
                return stream<Leaves, Padded, false, Counting>(
                    a, row, rays.part(begin, count), counters,
                    [&](std::size_t i, const NearestHit& best) { hits[begin + i] = to_hit(best); });
              },
              [&](std::size_t begin, std::size_t count) {
                InFlight().closest_hit(a, row, rays.part(begin, count), hits.subspan(begin, count), counters);
              });
        },
        [](const Accel& a, const KernelRow& row, RayBatch rays, std::span<std::uint8_t> occluded, Counters* counters) {
          run(
              rays,
              [&](std::size_t begin, std::size_t count) {
                return stream<Leaves, Padded, true, Counting>(
                    a, row, rays.part(begin, count), counters, [&](std::size_t i, const NearestHit& best) {
                      occluded[begin + i] = best.primitive != NearestHit::kNone;
                    });
              },
              [&](std::size_t begin, std::size_t count) {
                InFlight().any_hit(a, row, rays.part(begin, count), occluded.subspan(begin, count), counters);
              });
        }};
  }

  /// Calls streams(begin, count), which returns how many rays took a turn together, and queue(begin, count), until all
  /// rays are done.
  template <class InStreams, class InFlight>
  static void run(const RayBatch& rays, const InStreams& streams, const InFlight& queue) {
    bool shared = false;
    for (std::size_t begin = 0, then = kThen / 2; begin < rays.size();) {
      const std::size_t in_stream = std::min(shared ? then : kProbe, rays.size() - begin);
      const bool was_shared = std::exchange(shared, streams(begin, in_stream) >= kShared);
      then = shared == was_shared ? std::min(2 * then, kMost) : kThen;
      begin += in_stream;
      if (shared || begin == rays.size()) continue;
      const std::size_t in_flight = std::min(then, rays.size() - begin);
      queue(begin, in_flight);
      begin += in_flight;
    }
  }

  template <class Leaves, bool Padded, bool AnyHit, class Counting, class Report>
  static ARBORETUM_INLINE float stream(const Accel& a, const KernelRow& row, RayBatch rays, Counters* counters,
                                       const Report& report) {
    Streams<Format, Leaves, Padded, AnyHit, Counting> stream(static_cast<const bvh::BvhBase&>(a), row, rays,
                                                             Counting(counters));
    stream.run(report);
    if constexpr (Counting::kCounting) counters->rays += rays.size(), counters->rays_in_streams += rays.size();
    return stream.rays_a_turn();
  }
};

/// How `auto` traces rays that share little; arguments as those of BvhStreamsOrQueue. Scalar kernels are the reference,
/// not a race: independent rays go alone. On SSE rays in flight pay beside streams where a node is one or two registers
/// a plane.
template <class Format, template <class, bool, bool> class Queue, class Single,
          template <class, class, bool, bool, class> class Streams = Stream>
using IncoherentInStreams = std::conditional_t<
    kRegisterWidth == 1, Single,
    std::conditional_t<kRegisterWidth == 4 && (Format::kBranching == 4 || Format::kBranching == 8),
                       BvhStreamsOrQueue<Streams, Format, Queue, Single>, StreamFunctions<Streams, Format>>>;

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
