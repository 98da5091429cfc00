// One ray after the other: from a kernel that traces one ray to the functions and rows of the kernel table.
//
// Kernel<Leaves, Padded, Counting> has a constructor (const Accel&, const KernelRow&, Counting), called once a batch,
// and
//   template <bool AnyHit> bool trace(const Ray& ray, float time, NearestHit& best)
// for valid rays: any hit returns whether there is one, closest hit updates `best`. It may have settle(Hit&), the hit
// of the ray just traced, and finish_all(): t, u and v of hits are then final when that has been called.
#pragma once

#include "traversal/leaves.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <class Kernel, class Counting>
struct SingleRays {
  static void closest_hit(const Accel& accel, const KernelRow& row, RayBatch rays, std::span<Hit> hits,
                          Counters* counters) {
    const Counting counting(counters);
    Kernel kernel(accel, row, counting);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      NearestHit best{rays[i].tfar};
      if (is_valid_in_lanes(rays[i])) kernel.template trace<false>(rays[i], rays.time(i), best);
      hits[i] = to_hit(best);
      if constexpr (requires { kernel.settle(hits[i]); }) kernel.settle(hits[i]);
    }
    if constexpr (requires { kernel.finish_all(); }) kernel.finish_all();
    if constexpr (Counting::kCounting) counters->rays += rays.size();
  }
  static void any_hit(const Accel& accel, const KernelRow& row, RayBatch rays, std::span<std::uint8_t> occluded,
                      Counters* counters) {
    const Counting counting(counters);
    Kernel kernel(accel, row, counting);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      NearestHit best{rays[i].tfar};
      occluded[i] = is_valid_in_lanes(rays[i]) && kernel.template trace<true>(rays[i], rays.time(i), best);
    }
    if constexpr (Counting::kCounting) counters->rays += rays.size();
  }
};

/// Counting, leaves are always called: it is not timed.
template <template <class, bool, class> class Kernel>
struct SingleRayFunctions {
  template <class Leaves, bool Padded>
  static RowFunctions timed() {
    using Rays = SingleRays<Kernel<Leaves, Padded, NoCounters>, NoCounters>;
    return {&Rays::closest_hit, &Rays::any_hit};
  }
  template <bool Padded>
  static RowFunctions counting() {
    using Rays = SingleRays<Kernel<CalledLeaves, Padded, WithCounters>, WithCounters>;
    return {&Rays::closest_hit, &Rays::any_hit};
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
