// Box tests: one ray against the N child boxes of a node.
//
// BoxRay<N, false> keeps no promise at all: rounding can lose a box that the exact ray touches only at a face, edge or
// corner. BoxRay<N, true> never misses a box that the exact ray touches: its interval [near, far] holds the exact one,
// for every t (but see "tight" below).
//
// With FMA (AVX2, AVX-512) a plane costs one fused multiply: t = plane * r - o * r. Padded: the constants are
// o * r +- e with e = 2^-21 (M + |o|) |r|, M the scene's largest |coordinate|. Proof: r = (1/d)(1 + a), |a| <= u =
// 2^-24, so plane * r - o * r is off by u (M + |o|)|r| from (plane - o)/d; rounding o * r, adding e, and the fused
// operation's own rounding add less than u (|o| + |e| / |r| + M + |o|)|r| each: in all under 4 u (M + |o|)|r| = e / 2.
// A direction component below 2^-60 of the largest gets r = 2^60 / |d|max: the ray moves by less than the pad along
// that axis wherever it can meet the scene, and e alone is then larger than any such t, which is (M + |o|max) / |d|max
// at most. Where it is not, for a ray from more than some 2^39 M away, the axis is left out.
//
// Without FMA (scalar, SSE) t = (plane - o) * r with r = 1/d, infinite for 0; padded: the origin of the near planes is
// moved by e = 2^-21 (M + |o|) along the direction, that of the far planes against it (as Woop, Benthin, Wald 2013 do),
// so both ends of the interval are padded for the cost of none. Proof: the moved origin, the difference and the two
// factors round by less than 4 u (M + |o| + e)|r| together, which is under e |r|. (Ize's pad is in ize_box.h.) 0 * inf
// is NaN in the fast test; min_x86 and max_x86 keep their second operand, the running value, and so ignore it.
//
// Tight along the ray (BoxPad): where the direction is largest, along z say, e is only c |o||r| with c = 2^-23 (1 +
// 2^-20) (FMA), or 0, and the interval's ends are scaled by 1 -+ 2^-20 instead, once a ray and once a hit. No touched
// box is lost either. Proof (FMA): let the exact ray be in the box at T within the interval. The rounded o * r and f
// are off by (2 u + u^2)|o r| together, which e, however it is rounded, makes good, so near_z <= T (1 + 2 u) and far_z
// >= T (1 - 2 u), up to u^2. The pads of x and y are then e = 20 u (M + |o|)|r|, of which 4 u make good their own
// roundings; and (M + |o|)|r| >= T, since the ray is in the box at T: near_x <= T (1 - 16 u), far_x >= T (1 + 16 u). So
// an entry in z is before an exit in x, and the other way round, also where r is subnormal, so off by 4 u, x by 7 u and
// z by 5 or 6 u; in z itself the two are the same rounded, so monotone, function of planes that are in order; and the
// interval's own ends are scaled by 16 u. Without FMA z has three relative roundings, 3 u, and the rest is the same.
// Boxes that a ray starts on then do not count, where wide pads reach back over any step that it may have taken off its
// surface. Who may ask for it: intersectors that find nothing but what the exact ray meets (`exact`), or which a ray
// that is moved across z alone would meet, for what the pads of x and y stand, and at a distance between those of the
// nearest and the farthest corner along z (`watertight`: kDepthBetweenCorners; its sheared x is off by 3.5 u (M + |o|)
// where shears are fused and 4.5 u where not, the corners' errors being averaged as their depths are: with x's own 4 u
// and z's 2 or 3 u that is 9.5 or 11.5 u of the 20, where r is subnormal 15.5 or 17.5).
//
// Where few triangles have coordinates as large as M, structures put a smaller number in M's place, and widen the boxes
// of those triangles instead (structures/box_pads.h).
//
// Near and far planes are told apart by the sign bit of r, so that -0 goes with the negative directions.
#pragma once

#include "simd/swizzle.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Where a ray enters boxes at the earliest: tnear, and 0 for -0, since distances are ordered by their bits.
[[nodiscard]] ARBORETUM_INLINE float first_distance(const Ray& ray) { return ray.tnear > 0.0f ? ray.tnear : 0.0f; }

/// A ray's constants along an axis that are this large may overflow: the axis is left out of its tests.
inline constexpr float kTooLarge = 0x1p124f;

/// The pads e of axes, `parallel` those along which a ray does as good as not move: where such a pad may be less than a
/// t in the scene, one by which the axis is left out. `origin` and `largest`: the largest |component| of the ray's
/// origin and direction.
template <class F, class Mask>
[[nodiscard]] ARBORETUM_INLINE F pad_or_leave_out(F e, Mask parallel, F max_coordinate, F origin, F largest) {
  return select(parallel & ~(e > F(2.0f) * ((max_coordinate + origin) / largest)), F(kTooLarge), e);
}

/// What padded boxes are padded by. Tight (above) is for many rays that are prepared together (box_rays.h): one ray
/// alone loses by finding its largest axis what it gains (docs/performance.md).
struct BoxPad {
  /// shares: of M + |o|, along other axes than a tight one, and of |o| along that
  static constexpr float kWide = 0x1p-21f, kBeside = 0x1.4p-20f, kAlong = kHasFma ? 0x1.00001p-23f : 0.0f;
  /// At least; more than what underflow takes from products.
  static constexpr float kLeast = 0x1p-100f;

  float max_coordinate;  ///< M
  bool tight = false;    ///< along the axis where the direction is largest

  /// What the interval's ends are scaled by.
  [[nodiscard]] ARBORETUM_INLINE float before() const { return tight ? 1.0f - 0x1p-20f : 1.0f; }
  [[nodiscard]] ARBORETUM_INLINE float beyond() const { return tight ? 1.0f + 0x1p-20f : 1.0f; }
};

/// One ray's constants for boxes.
template <int N, bool Padded>
struct BoxRay {
  static constexpr int W = lanes_for(N);
  static constexpr unsigned kSide = N * sizeof(float);

  Vec3f r;            ///< reciprocal direction
  Vec3f near_offset;  ///< for the near planes: o * r (FMA) or the origin (no FMA), padded
  Vec3f far_offset;   ///< the same for the far planes
  unsigned octant;    ///< bit a: the direction is negative along axis a, or is -0

  /// The axes stand in lanes: some forty instructions fewer a ray than one axis after the other.
  ARBORETUM_INLINE BoxRay(const Ray& ray, float max_coordinate) {
    using F = vf<4>;
    // Behind the direction stands tfar: of the largest float the reciprocal is subnormal.
    const F o = F::load(&ray.origin), d = xyzx(F::load(&ray.direction));
    F rs, nears, fars;
    constants<Padded>(
        o, d, F(largest_component(ray.direction)), [&] { return F(largest_component(ray.origin)); }, F(max_coordinate),
        F(BoxPad::kWide), rs, nears, fars);
    r = axes(rs), near_offset = axes(nears), far_offset = axes(fars);
    if (__builtin_expect((overflows(d, rs, nears, fars).bits() & 7u) != 0, 0))
      leave_out(ray.direction.x, r.x, near_offset.x, far_offset.x),
          leave_out(ray.direction.y, r.y, near_offset.y, far_offset.y),
          leave_out(ray.direction.z, r.z, near_offset.z, far_offset.z);
    octant = sign_mask(rs) & 7u;
  }
  /// Of constants that are known: those of such a BoxRay.
  ARBORETUM_INLINE BoxRay(Vec3f known_r, Vec3f known_near, Vec3f known_far)
      : r(known_r), near_offset(known_near), far_offset(known_far),
        octant(sign_bit(r.x) | sign_bit(r.y) << 1 | sign_bit(r.z) << 2) {}

  /// Where a node's near planes lie: in bytes from its begin.
  ARBORETUM_INLINE unsigned near_x() const { return (octant & 1u) * kSide; }
  ARBORETUM_INLINE unsigned near_y() const { return (2 + (octant >> 1 & 1u)) * kSide; }
  ARBORETUM_INLINE unsigned near_z() const { return (4 + (octant >> 2)) * kSide; }

  /// The constants of a lane's axis, or of one axis of a lane's ray. `largest` and `origin()`: the largest |component|
  /// of the ray's direction and origin; the pad is a `share` of max_coordinate + |o|.
  template <bool Pad, class F, class Origin>
  static ARBORETUM_INLINE void constants(F o, F d, F largest, [[maybe_unused]] const Origin& origin,
                                         [[maybe_unused]] F max_coordinate, [[maybe_unused]] F share, F& r, F& near,
                                         F& far) {
    if constexpr (kHasFma) {
      r = F(1.0f) / d;
      // A branch, rarely taken: no division waits for `largest`.
      const auto tiny = ~(abs(d) > largest * F(0x1p-60f));
      if (__builtin_expect(any(tiny), 0)) r = select(tiny, xor_sign(F(0x1p60f) / largest, sign_bits(d)), r);
      near = far = o * r;
      if constexpr (Pad) {
        // In this order: 2^-21 of a tiny scene may be nothing
        F e = share * ((max_coordinate + abs(o)) * abs(r)) + F(BoxPad::kLeast);
        if (__builtin_expect(any(tiny), 0)) e = pad_or_leave_out(e, tiny, max_coordinate, origin(), largest);
        near = near + e, far = far - e;
      }
    } else {
      r = F(1.0f) / d;
      near = far = o;
      if constexpr (Pad) {
        const F e = xor_sign(share * (max_coordinate + abs(o)) + F(BoxPad::kLeast), sign_bits(r));
        near = near + e, far = far - e;
      }
    }
  }
  /// Where the constants of such directions are too large, or NaN, and must be mended; so is an infinite reciprocal of
  /// anything but 0.
  template <class F>
  static ARBORETUM_INLINE auto overflows(F d, F r, F near, F far) {
    const auto too_large = ~(abs(near) + abs(far) < F(kTooLarge));
    if constexpr (kHasFma) {
      return too_large;  // r is part of `near`
    } else {
      return too_large | ((abs(r) == F(std::numeric_limits<float>::infinity())) & (d != F(0.0f)));
    }
  }

 private:
  static ARBORETUM_INLINE unsigned sign_bit(float a) { return __builtin_bit_cast(std::uint32_t, a) >> 31; }
  static ARBORETUM_INLINE Vec3f axes(vf<4> a) { return {lane<0>(a), lane<1>(a), lane<2>(a)}; }
  /// An axis whose constants overflow: with it a child that does not exist would be met, infinite planes giving NaN.
  /// Its interval becomes all t for boxes that exist, and stays empty for others.
  static void leave_out(float d, float& r, float& near, float& far) {
    const bool infinite = !kHasFma && __builtin_fabsf(r) == std::numeric_limits<float>::infinity() && d != 0.0f;
    if (!infinite && __builtin_fabsf(near) + __builtin_fabsf(far) < kTooLarge) return;
    constexpr float largest = std::numeric_limits<float>::max();
    r = __builtin_copysignf(1.0f, r);
    near = kHasFma ? largest : __builtin_copysignf(largest, r);
    far = -near;
  }
};

/// The constants in registers, one ray on all lanes: fx to fz the near planes' offsets, gx to gz the far ones'.
template <int N, bool Padded>
struct BoxLanes {
  static constexpr int W = BoxRay<N, Padded>::W;
  static constexpr unsigned kSide = BoxRay<N, Padded>::kSide;
  using F = vf<W>;
  F rx, ry, rz, fx, fy, fz, gx, gy, gz;
  unsigned near_x, near_y, near_z;

  ARBORETUM_INLINE explicit BoxLanes(const BoxRay<N, Padded>& b)
      : rx(b.r.x), ry(b.r.y), rz(b.r.z), fx(b.near_offset.x), fy(b.near_offset.y), fz(b.near_offset.z),
        gx(b.far_offset.x), gy(b.far_offset.y), gz(b.far_offset.z), near_x(b.near_x()), near_y(b.near_y()),
        near_z(b.near_z()) {}

  /// Entry distances (at least tnear) and, as bits, the children whose interval within [tnear, tfar] is not empty.
  ARBORETUM_INLINE unsigned test(const std::byte* node, F tnear, F tfar, F& entry) const {
    return test_planes([node](unsigned offset) { return load_first<N>(node + offset); }, tnear, tfar, entry);
  }

  /// The same for planes that are made from the node: `planes(offset)` gives those that lie `offset` bytes behind its
  /// begin.
  template <class Planes>
  ARBORETUM_INLINE unsigned test_planes(const Planes& planes, F tnear, F tfar, F& entry) const {
    const unsigned bits = meets(planes, tnear, tfar, entry).bits();
    return N == W ? bits : bits & ((1u << N) - 1u);
  }
  /// The same as lanes, of which those from N on hold nothing.
  template <class Planes>
  ARBORETUM_INLINE vm<W> meets(const Planes& planes, F tnear, F tfar, F& entry) const {
    return meets({planes(near_x), planes(near_y), planes(near_z)},
                 {planes(near_x ^ kSide), planes(far(near_y, 2)), planes(far(near_z, 4))}, tnear, tfar, entry);
  }
  /// The same for the near and the far planes themselves.
  ARBORETUM_INLINE vm<W> meets(const vf3<W>& near, const vf3<W>& far, F tnear, F tfar, F& entry) const {
    F nx, ny, nz, lx, ly, lz;
    if constexpr (kHasFma) {
      nx = msub(near.x, rx, fx), ny = msub(near.y, ry, fy), nz = msub(near.z, rz, fz);
      const F hx = Padded ? gx : fx, hy = Padded ? gy : fy, hz = Padded ? gz : fz;
      lx = msub(far.x, rx, hx), ly = msub(far.y, ry, hy), lz = msub(far.z, rz, hz);
    } else {
      nx = (near.x - fx) * rx, ny = (near.y - fy) * ry, nz = (near.z - fz) * rz;
      lx = (far.x - gx) * rx, ly = (far.y - gy) * ry, lz = (far.z - gz) * rz;
    }
    // Two levels instead of three. A NaN may take a neighbour's bound with it: the interval only grows.
    entry = max_x86(max_x86(nx, ny), max_x86(nz, tnear));
    const F exit = min_x86(min_x86(lx, ly), min_x86(lz, tfar));
    return entry <= exit;
  }

 private:
  static ARBORETUM_INLINE unsigned far(unsigned near, unsigned axis_planes) {
    return (2 * axis_planes + 1) * kSide - near;
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
