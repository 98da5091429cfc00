// Box test of Ize (Robust BVH Ray Traversal, JCGT 2(2) 2013): t = (plane - origin) * r, the reciprocal of the far
// planes two ulp larger.
//
// What it keeps: with positive t each end of an interval is off by three roundings, a factor within (1 +- u)^3, u =
// 2^-24, and two ulp of a reciprocal are at least 2 u of it. So a box is met, as long as coordinates are within 2^-40
// .. 2^40 and no component of the direction is subnormal, in which the ray's interval [a, b] within [tnear, tfar] has b
// >= (1 + 2^-22) a: (1 + u)^3 a <= (1 - u)^3 (1 + 2 u) b. Of the boxes that a ray touches in less, at an edge or a
// corner, it loses some in a million: two ulp are the paper's, three roundings on either side can add up to nearly
// three (tests/test_boxes.cpp has such a box). And it widens the far end alone: a box whose triangle is an ulp nearer
// than the best hit, or as near, may be culled. A plane through the origin of a ray that does not move along its axis
// gives 0 * inf, NaN, which min_x86 and max_x86 ignore as in box_test.h.
#pragma once

#include "traversal/box_test.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// One ray's constants in registers, the ray on all lanes: what BoxLanes is for the other box tests.
template <int N>
struct IzeLanes {
  static constexpr int W = lanes_for(N);
  static constexpr unsigned kSide = N * sizeof(float);
  using F = vf<W>;
  F ox, oy, oz, rx, ry, rz, gx, gy, gz;  ///< origin, reciprocals for the near planes, for the far ones
  unsigned near_x, near_y, near_z;       ///< where a node's near planes lie: in bytes from its begin

  ARBORETUM_INLINE explicit IzeLanes(const Ray& ray) : ox(ray.origin.x), oy(ray.origin.y), oz(ray.origin.z) {
    const vf<4> r = vf<4>(1.0f) / xyzx(vf<4>::load(&ray.direction));
    // Infinite, or nearly: it stays.
    const vf<4> wider = select(abs(r) < vf<4>(0x1p127f), vf<4>::from_int_bits(r.as_int() + vi<4>(2)), r);
    rx = F(lane<0>(r)), ry = F(lane<1>(r)), rz = F(lane<2>(r));
    gx = F(lane<0>(wider)), gy = F(lane<1>(wider)), gz = F(lane<2>(wider));
    const unsigned octant = sign_mask(r);
    near_x = (octant & 1u) * kSide, near_y = (2 + (octant >> 1 & 1u)) * kSide,
    near_z = (4 + (octant >> 2 & 1u)) * kSide;
  }

  /// As BoxLanes::test.
  ARBORETUM_INLINE unsigned test(const std::byte* node, F tnear, F tfar, F& entry) const {
    const auto planes = [node](unsigned offset) { return load_first<N>(node + offset); };
    const F nx = (planes(near_x) - ox) * rx, ny = (planes(near_y) - oy) * ry, nz = (planes(near_z) - oz) * rz;
    const F lx = (planes(near_x ^ kSide) - ox) * gx, ly = (planes(5 * kSide - near_y) - oy) * gy,
            lz = (planes(9 * kSide - near_z) - oz) * gz;
    entry = max_x86(max_x86(nx, ny), max_x86(nz, tnear));
    const unsigned bits = (entry <= min_x86(min_x86(lx, ly), min_x86(lz, tfar))).bits();
    return N == W ? bits : bits & ((1u << N) - 1u);
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
