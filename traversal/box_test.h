// Box tests: one ray against the N child boxes of a node.
//
// FastBox keeps no promise at all: rounding can lose a box that the exact ray touches only at a face, edge or corner.
// PaddedBox never misses a box that the exact ray touches: its interval [near, far] holds the exact one, for every t.
//
// With FMA (AVX2, AVX-512) a plane costs one fused multiply: t = plane * r - o * r. Padded: the constants are
// o * r +- e with e = 2^-21 (M + |o|) |r|, M the scene's largest |coordinate|. Proof: r = (1/d)(1 + a), |a| <= u = 2^-24, so
// plane * r - o * r is off by u (M + |o|)|r| from (plane - o)/d; rounding o * r, adding e, and the fused operation's own
// rounding add less than u (|o| + |e| / |r| + M + |o|)|r| each: in all under 4 u (M + |o|)|r| = e / 2. A direction component below
// 2^-60 of the largest gets r = 2^60 / |d|max: the ray moves by less than the pad along that axis wherever it can meet the
// scene, and e alone is then larger than any such t.
//
// Without FMA (scalar, SSE) t = (plane - o) * r with r = 1/d, infinite for 0; padded: the origin of the near planes is moved
// by e = 2^-21 (M + |o|) along the direction, that of the far planes against it (as Woop, Benthin, Wald 2013 do), so both ends
// of the interval are padded for the cost of none. Proof: the moved origin, the difference and the two factors round by less
// than 4 u (M + |o| + e)|r| together, which is under e |r|. (Ize's pad, JCGT 2(2) 2013, widens the far end alone: no box is
// missed, but one whose triangle is an ulp nearer than the best hit can be culled.) 0 * inf is NaN in the fast test;
// min_x86 and max_x86 keep their second operand, the running value, and so ignore it.
//
// Near and far planes are told apart by the sign bit of r, so that -0 goes with the negative directions.
#pragma once

#include "simd/simd.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Where a ray enters boxes at the earliest: tnear, and 0 for -0, since distances are ordered by their bits.
[[nodiscard]] ARBORETUM_INLINE float first_distance(const Ray& ray) { return ray.tnear > 0.0f ? ray.tnear : 0.0f; }

/// One ray's constants for boxes: near[axis] is the byte offset of the near planes within a node of N children.
template <int N, bool Padded>
struct BoxRay {
  static constexpr int W = N < 4 ? 4 : N;
  static constexpr unsigned kSide = N * sizeof(float);

  float rx, ry, rz;
  float fx, fy, fz;  ///< for the near planes: o * r (FMA) or the origin (no FMA), padded
  float gx, gy, gz;  ///< the same for the far planes
  unsigned near_x, near_y, near_z;

  ARBORETUM_INLINE BoxRay(const Ray& ray, float max_coordinate) {
    const Vec3f o = ray.origin, d = ray.direction;
    if constexpr (kHasFma) {
      const float dmax = largest(d);
      const float tiny = dmax * 0x1p-60f;
      const float limit = 0x1p60f / dmax;
      rx = reciprocal(d.x, tiny, limit), ry = reciprocal(d.y, tiny, limit), rz = reciprocal(d.z, tiny, limit);
      fx = gx = o.x * rx, fy = gy = o.y * ry, fz = gz = o.z * rz;
      if constexpr (Padded) {
        const float ex = pad(o.x, rx, max_coordinate), ey = pad(o.y, ry, max_coordinate), ez = pad(o.z, rz, max_coordinate);
        fx += ex, fy += ey, fz += ez;
        gx -= ex, gy -= ey, gz -= ez;
      }
    } else {
      rx = 1.0f / d.x, ry = 1.0f / d.y, rz = 1.0f / d.z;
      fx = gx = o.x, fy = gy = o.y, fz = gz = o.z;
      if constexpr (Padded) {
        const float ex = shift(o.x, rx, max_coordinate), ey = shift(o.y, ry, max_coordinate), ez = shift(o.z, rz, max_coordinate);
        fx += ex, fy += ey, fz += ez;
        gx -= ex, gy -= ey, gz -= ez;
      }
    }
    if (__builtin_expect(!(size(fx, gx) + size(fy, gy) + size(fz, gz) < kLargest), 0))
      leave_out(rx, fx, gx), leave_out(ry, fy, gy), leave_out(rz, fz, gz);
    near_x = __builtin_signbit(rx) ? kSide : 0u;
    near_y = 2 * kSide + (__builtin_signbit(ry) ? kSide : 0u);
    near_z = 4 * kSide + (__builtin_signbit(rz) ? kSide : 0u);
  }

  /// Constants whose sizes add up to this much are mended axis by axis; packets ask the same (bvh_packet.h).
  static constexpr float kLargest = 0x1p125f;

 private:
  static ARBORETUM_INLINE float largest(Vec3f d) {
    const float x = __builtin_fabsf(d.x), y = __builtin_fabsf(d.y), z = __builtin_fabsf(d.z);
    const float xy = x > y ? x : y;
    return xy > z ? xy : z;
  }
  static ARBORETUM_INLINE float size(float f, float g) { return __builtin_fabsf(f) + __builtin_fabsf(g); }
  /// An axis whose constants overflow: with it a child that does not exist would be met, infinite planes giving NaN. Its interval becomes
  /// all t for boxes that exist, and stays empty for others.
  static void leave_out(float& r, float& f, float& g) {
    if (size(f, g) < kLargest / 4) return;
    constexpr float largest = std::numeric_limits<float>::max();
    r = __builtin_copysignf(1.0f, r);
    f = kHasFma ? largest : __builtin_copysignf(largest, r);
    g = -f;
  }
  static ARBORETUM_INLINE float reciprocal(float d, float tiny, float limit) {
    return __builtin_fabsf(d) > tiny ? 1.0f / d : __builtin_copysignf(limit, d);
  }
  static ARBORETUM_INLINE float shift(float o, float r, float max_coordinate) {
    return __builtin_copysignf(0x1p-21f * (max_coordinate + __builtin_fabsf(o)) + 0x1p-100f, r);
  }
  static ARBORETUM_INLINE float pad(float o, float r, float max_coordinate) {
    return 0x1p-21f * (max_coordinate + __builtin_fabsf(o)) * __builtin_fabsf(r) + 0x1p-100f;
  }
};

/// The constants in registers, one ray on all lanes.
template <int N, bool Padded>
struct BoxLanes {
  static constexpr int W = BoxRay<N, Padded>::W;
  static constexpr unsigned kSide = BoxRay<N, Padded>::kSide;
  using F = vf<W>;
  F rx, ry, rz, fx, fy, fz, gx, gy, gz;
  unsigned near_x, near_y, near_z;

  ARBORETUM_INLINE explicit BoxLanes(const BoxRay<N, Padded>& b)
      : rx(b.rx), ry(b.ry), rz(b.rz), fx(b.fx), fy(b.fy), fz(b.fz), gx(b.gx), gy(b.gy), gz(b.gz),
        near_x(b.near_x), near_y(b.near_y), near_z(b.near_z) {}

  /// Entry distances (at least tnear) and, as bits, the children whose interval within [tnear, tfar] is not empty.
  ARBORETUM_INLINE unsigned test(const std::byte* node, F tnear, F tfar, F& entry) const {
    return test_planes([node](unsigned offset) { return F::load(node + offset); }, tnear, tfar, entry);
  }

  /// The same for planes that are made from the node: `planes(offset)` gives those that lie `offset` bytes behind its begin.
  template <class Planes>
  ARBORETUM_INLINE unsigned test_planes(const Planes& planes, F tnear, F tfar, F& entry) const {
    F nx, ny, nz, lx, ly, lz;
    if constexpr (kHasFma) {
      nx = msub(planes(near_x), rx, fx), ny = msub(planes(near_y), ry, fy), nz = msub(planes(near_z), rz, fz);
      const F hx = Padded ? gx : fx, hy = Padded ? gy : fy, hz = Padded ? gz : fz;
      lx = msub(planes(near_x ^ kSide), rx, hx), ly = msub(planes(far(near_y, 2)), ry, hy), lz = msub(planes(far(near_z, 4)), rz, hz);
    } else {
      nx = (planes(near_x) - fx) * rx, ny = (planes(near_y) - fy) * ry, nz = (planes(near_z) - fz) * rz;
      lx = (planes(near_x ^ kSide) - gx) * rx, ly = (planes(far(near_y, 2)) - gy) * ry, lz = (planes(far(near_z, 4)) - gz) * rz;
    }
    // Two levels instead of three. A NaN may take a neighbour's bound with it: the interval only grows.
    entry = max_x86(max_x86(nx, ny), max_x86(nz, tnear));
    const F exit = min_x86(min_x86(lx, ly), min_x86(lz, tfar));
    const unsigned bits = (entry <= exit).bits();
    return N == W ? bits : bits & ((1u << N) - 1u);
  }

 private:
  static ARBORETUM_INLINE unsigned far(unsigned near, unsigned axis_planes) { return (2 * axis_planes + 1) * kSide - near; }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
