// Up to 64 rays side by side, each with the constants of its box tests.
#pragma once

#include "traversal/box_test.h"
#include "traversal/lane_rays.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Where rays with the constants r and c (BoxRay) meet a plane.
template <class F>
[[nodiscard]] ARBORETUM_INLINE F plane_distance(F plane, F r, F c) {
  if constexpr (kHasFma) {
    return msub(plane, r, c);
  } else {
    return (plane - c) * r;
  }
}

/// Structures of arrays. The constants are computed W rays at a time by the operations of BoxRay, so they are the same
/// bits, but for pads that are tight along the ray.
struct BoxRays : LaneRays {
  alignas(64) float r[3][kMost], near[3][kMost], far[3][kMost];  ///< as BoxRay's r and offsets
  alignas(64) float first[kMost];                                ///< distance from which boxes count
  std::uint64_t overflowed;  ///< those whose constants overflow, so that BoxRay mended them

  /// As LaneRays::prepare().
  template <int W, int N, class RayAt, class Each>
  ARBORETUM_INLINE void prepare(int count, const RayAt& ray_at, bool padded, BoxPad pad, const Each& each) {
    overflowed = 0;
    LaneRays::prepare<W>(count, ray_at, [&](int k) {
      constants<W, N>(k, padded, pad);
      each(k);
    });
    if (__builtin_expect((overflowed &= valid) != 0, 0)) {
      for (std::uint64_t rest = overflowed; rest; rest &= rest - 1) {
        const int i = __builtin_ctzll(rest);
        if (padded) {
          mend(i, BoxRay<N, true>(ray_at(i), pad.max_coordinate));
        } else {
          mend(i, BoxRay<N, false>(ray_at(i), pad.max_coordinate));
        }
      }
    }
  }

 private:
  template <int W, int N>
  ARBORETUM_INLINE void constants(int k, bool padded, BoxPad pad) {
    using F = vf<W>;
    using Box = BoxRay<N, true>;
    const F o[3] = {F::load(rays.origin[0] + k), F::load(rays.origin[1] + k), F::load(rays.origin[2] + k)};
    const F d[3] = {F::load(rays.direction[0] + k), F::load(rays.direction[1] + k), F::load(rays.direction[2] + k)};
    const F largest = largest_component(d[0], d[1], d[2]);
    const auto origin = [&] { return largest_component(o[0], o[1], o[2]); };
    (max_x86(F::load(rays.tnear + k), F(0.0f)) * F(pad.before())).store(first + k);
    F reach[3], share[3];
    for (int a = 0; a < 3; ++a)
      reach[a] = F(pad.max_coordinate), share[a] = F(pad.tight ? BoxPad::kBeside : BoxPad::kWide);
    if (pad.tight) {  // along the axis that largest_last() takes, of equal ones too
      const F x = abs(d[0]), y = abs(d[1]), z = abs(d[2]);
      const vm<W> by_x = (x > y) & (x > z), by_y = ~(x > y) & (y > z), along[3] = {by_x, by_y, ~(by_x | by_y)};
      for (int a = 0; a < 3; ++a)
        reach[a] = select(along[a], F(0.0f), reach[a]), share[a] = select(along[a], F(BoxPad::kAlong), share[a]);
    }
    vm<W> overflows(false);
    for (int a = 0; a < 3; ++a) {
      F rs, nears, fars;
      if (padded) {
        Box::template constants<true>(o[a], d[a], largest, origin, reach[a], share[a], rs, nears, fars);
      } else {
        Box::template constants<false>(o[a], d[a], largest, origin, reach[a], share[a], rs, nears, fars);
      }
      rs.store(r[a] + k), nears.store(near[a] + k), fars.store(far[a] + k);
      overflows = overflows | Box::overflows(d[a], rs, nears, fars);
    }
    overflowed |= std::uint64_t(overflows.bits()) << k;
  }

  template <class Box>
  void mend(int i, const Box& box) {
    r[0][i] = box.r.x, r[1][i] = box.r.y, r[2][i] = box.r.z;
    near[0][i] = box.near_offset.x, near[1][i] = box.near_offset.y, near[2][i] = box.near_offset.z;
    far[0][i] = box.far_offset.x, far[1][i] = box.far_offset.y, far[2][i] = box.far_offset.z;
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
