// What every ISA shares: mask tests, absolute values, sign handling, and three of them as a vector.
#pragma once

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <int W>
ARBORETUM_INLINE bool any(vm<W> m) {
  return m.bits() != 0;
}
template <int W>
ARBORETUM_INLINE bool none(vm<W> m) {
  return m.bits() == 0;
}
template <int W>
ARBORETUM_INLINE bool all(vm<W> m) {
  return m.bits() == (1u << W) - 1u;
}

template <int W>
ARBORETUM_INLINE vf<W> abs(vf<W> a) {
  return vf<W>::from_int_bits(a.as_int() & vi<W>(0x7fffffff));
}
/// max(|a|, |b|); where one is NaN either that or the other's.
template <int W>
ARBORETUM_INLINE vf<W> max_abs(vf<W> a, vf<W> b) {
  if constexpr (requires { max_abs_in_one(a, b); }) {
    return max_abs_in_one(a, b);
  } else {
    return max_x86(abs(a), abs(b));
  }
}
/// The sign bit of each lane, nothing else.
template <int W>
ARBORETUM_INLINE vi<W> sign_bits(vf<W> a) {
  return a.as_int() & vi<W>(std::numeric_limits<std::int32_t>::min());
}
template <int W>
ARBORETUM_INLINE vf<W> xor_sign(vf<W> a, vi<W> sign) {
  return vf<W>::from_int_bits(a.as_int() ^ sign);
}
template <int W>
ARBORETUM_INLINE vf<W> operator-(vf<W> a) {
  return xor_sign(a, vi<W>(std::numeric_limits<std::int32_t>::min()));
}

/// The largest |component| of a point or direction; of W of them, given by component.
template <class Vector>
[[nodiscard]] ARBORETUM_INLINE float largest_component(const Vector& v) {
  const float x = __builtin_fabsf(v.x), y = __builtin_fabsf(v.y), z = __builtin_fabsf(v.z), xy = x > y ? x : y;
  return xy > z ? xy : z;
}
template <int W>
[[nodiscard]] ARBORETUM_INLINE vf<W> largest_component(vf<W> x, vf<W> y, vf<W> z) {
  return max_abs(max_abs(x, y), z);
}

/// Lane I of four.
template <int I>
ARBORETUM_INLINE float lane(vf<4> a) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
  return a.lane[I];
#else
  return _mm_cvtss_f32(I == 0 ? a.v : _mm_shuffle_ps(a.v, a.v, I * 0x55));
#endif
}

/// Bit i: the sign of lane i.
ARBORETUM_INLINE unsigned sign_mask(vf<4> a) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
  return (sign_bits(a) < vi<4>(0)).bits();
#else
  return unsigned(_mm_movemask_ps(a.v));
#endif
}

/// Three vectors of lanes: as many points or directions.
template <class F>
struct vec3 {
  F x, y, z;
  friend ARBORETUM_INLINE vec3 operator-(vec3 a, vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend ARBORETUM_INLINE vec3 operator+(vec3 a, vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
};
template <int W>
using vf3 = vec3<vf<W>>;

/// Fused where the ISA has FMA.
template <class F>
ARBORETUM_INLINE F dot(vec3<F> a, vec3<F> b) {
  return madd(a.x, b.x, madd(a.y, b.y, a.z * b.z));
}
/// Fused where the ISA has FMA.
template <class F>
ARBORETUM_INLINE vec3<F> cross(vec3<F> a, vec3<F> b) {
  return {msub(a.y, b.z, a.z * b.y), msub(a.z, b.x, a.x * b.z), msub(a.x, b.y, a.y * b.x)};
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
