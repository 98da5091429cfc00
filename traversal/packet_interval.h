// Which triangles of a block no ray of a packet can hit, found for all rays at once.
//
// With C = v0 - o, A = e2 x C, B = e1 x C, N = e2 x e1 (as in intersectors/moller_trumbore.h) a ray of direction d
// meets the triangle only where A.d, B.d and (N - A - B).d have the sign of N.d or are zero. Origins and directions are
// boxes: centre and half extent. Each of these products then lies within a radius about its value at the centres; where
// all of one is beyond zero on the wrong side no ray of the packet meets the triangle. What an intersector computes is
// off the exact value by some 20 u (|C| + |e|)^2 |d|, u = 2^-24, whether its form is this one or the sheared one of
// intersectors/watertight.h; the radius is widened by 2^-17 of the same. The products do not change along a line, so
// any point of each ray may stand for its origin as long as that width is of the origin's C. So no triangle is left out
// that an intersector would hit.
#pragma once

#include "intersectors/triangle_hits.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// The smallest and the largest of some values by axis, in the first three lanes.
struct AxisBounds {
  vf<4> low, high;
  /// The largest |value|.
  [[nodiscard]] ARBORETUM_INLINE vf<4> largest() const { return max_x86(-low, high); }
};

/// Origins and directions of a packet by axis: centre and half extent, rounded up.
struct PacketInterval {
  alignas(16) float origin[4], origin_half[4], direction[4], direction_half[4];
  float reach = 0.0f;  ///< how far the rays' origins are at most (sum over the axes) from points on their lines that
                       ///< stand in `origin` instead

  ARBORETUM_INLINE void set(const AxisBounds& o, const AxisBounds& d) {
    const auto store = [](const AxisBounds& b, float* centres, float* halves) {
      const vf<4> centre = vf<4>(0.5f) * (b.low + b.high);
      centre.store(centres);
      (max_x86(b.high - centre, centre - b.low) * vf<4>(1.0f + 0x1p-20f)).store(halves);
    };
    store(o, origin, origin_half), store(d, direction, direction_half);
  }
};

/// The triangles that are left, as bits. Empty lanes are left out.
template <class Block>
[[nodiscard]] ARBORETUM_INLINE unsigned interval_triangles(const PacketInterval& p, const Block& block) {
  constexpr int W = Block::kWidth;
  using F = vf<W>;
  using V = vf3<W>;
  const auto load = [](const float(&x)[3][W]) { return V{F::load(x[0]), F::load(x[1]), F::load(x[2])}; };
  const auto all = [](const float(&x)[4]) { return V{F(x[0]), F(x[1]), F(x[2])}; };
  const auto absolute = [](V a) { return V{abs(a.x), abs(a.y), abs(a.z)}; };
  const auto sum = [](V a) { return a.x + a.y + a.z; };
  const auto plus = [](V a, V b) { return V{a.x + b.x, a.y + b.y, a.z + b.z}; };
  /// |a x b| at most, for |a| and |b|.
  const auto cross_bound = [](V a, V b) {
    return V{a.y * b.z + a.z * b.y, a.z * b.x + a.x * b.z, a.x * b.y + a.y * b.x};
  };

  const V v0 = load(block.v0);
  V e1, e2;
  if constexpr (Block::kForm == TriangleForm::edges) {
    e1 = load(block.e1), e2 = load(block.e2);
  } else {
    e1 = v0 - load(block.v1), e2 = load(block.v2) - v0;
  }
  const V c = v0 - all(p.origin), c_half = all(p.origin_half), d = all(p.direction), d_half = all(p.direction_half);
  const V n = cross(e2, e1), A = cross(e2, c), B = cross(e1, c);
  const V abs_e1 = absolute(e1), abs_e2 = absolute(e2), abs_d = absolute(d);
  const F size = sum(absolute(c)) + sum(c_half) + sum(abs_e1) + sum(abs_e2) + F(p.reach);
  const F least(0x1p-126f);  // products below it lose bits
  const F slack = (F(0x1p-17f) * size * size + least) * sum(plus(abs_d, d_half)) + least;
  // Radius of X.d for X within half of its centre: |d| half + d_half (|X| + half).
  const auto radius = [&](V X, V half) { return dot(plus(abs_d, d_half), half) + dot(d_half, absolute(X)) + slack; };
  const V A_half = cross_bound(abs_e2, c_half), B_half = cross_bound(abs_e1, c_half);
  const F det = dot(n, d), det_radius = dot(d_half, absolute(n)) + slack;
  const vi<W> sign = sign_bits(det);
  const V rest = n - A - B;
  const F u = xor_sign(dot(A, d), sign) + radius(A, A_half);
  const F v = xor_sign(dot(B, d), sign) + radius(B, B_half);
  const F w = xor_sign(dot(rest, d), sign) + radius(rest, plus(A_half, B_half));
  // Of one sign for all rays; and only where nothing can have overflowed: sums of products are below 4 size^2 |d|,
  // which is 2^19 times the slack at most.
  const vm<W> facing = (abs(det) > det_radius) & (slack < F(0x1p108f));
  const vm<W> out = facing & ((u < F(0.0f)) | (v < F(0.0f)) | (w < F(0.0f)));
  // Comparisons with an empty lane's NaN are false: it must be left out by its id.
  return (~(out | (vi<W>::load(block.id) == vi<W>(-1)))).bits();
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
