// What an intersector gives back for W lanes: t, and u and v as numerators over one denominator, divided only for the
// lane that wins.
#pragma once

#include "intersectors/blocks.h"
#include "simd/simd.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <int W>
struct TriangleHits {
  vf<W> t;
  vf<W> u_numerator, v_numerator, denominator;
};

/// The line of one ray: for intersectors that prepare nothing more of it.
struct RayLine {
  Vec3f origin, direction;
  ARBORETUM_INLINE explicit RayLine(const Ray& ray) : origin(ray.origin), direction(ray.direction) {}
};

template <int W>
[[nodiscard]] ARBORETUM_INLINE vf3<W> in_all_lanes(Vec3f a) {
  return {vf<W>(a.x), vf<W>(a.y), vf<W>(a.z)};
}

/// Rays of a packet as structures of arrays.
struct PacketRays {
  static constexpr int kMost = 64;
  alignas(64) float origin[3][kMost], direction[3][kMost], tnear[kMost];
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
