// vd<W>: W doubles in one register, for arithmetic on floats that must not round; W = 1 everywhere, 2 on SSE, 4 on AVX2, 4 and 8 on
// AVX-512. There are no pairs of registers: a block of more triangles is worked through kDoubleLanes at a time, so that the numbers of
// one group fit the registers.
//
// Semantics as vf<W>'s (simd/simd.h): min_x86 and max_x86 keep the second operand when one is NaN, comparisons are ordered but for !=.
// They give one bit a lane instead of a mask. Include only between simd/target_begin.h and simd/target_end.h.
#pragma once

#include "simd/simd.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <int W>
struct vd;

/// How many of W lanes are worked on at a time in double.
template <int W>
inline constexpr int kDoubleLanes = kRegisterWidth / 2 >= W ? W
                                    : kRegisterWidth >= 4   ? kRegisterWidth / 2
                                                            : 1;

template <>
struct vd<1> {
  double v;
  vd() = default;
  ARBORETUM_INLINE vd(double s) : v(s) {}
  /// Widens W floats.
  static ARBORETUM_INLINE vd load(const float* p) { return double(*p); }
  /// Rounds to W floats.
  ARBORETUM_INLINE void store(float* p) const { *p = float(v); }
  friend ARBORETUM_INLINE vd operator+(vd a, vd b) { return a.v + b.v; }
  friend ARBORETUM_INLINE vd operator-(vd a, vd b) { return a.v - b.v; }
  friend ARBORETUM_INLINE vd operator*(vd a, vd b) { return a.v * b.v; }
  friend ARBORETUM_INLINE vd operator/(vd a, vd b) { return a.v / b.v; }
  friend ARBORETUM_INLINE vd min_x86(vd a, vd b) { return a.v < b.v ? a.v : b.v; }
  friend ARBORETUM_INLINE vd max_x86(vd a, vd b) { return a.v > b.v ? a.v : b.v; }
  friend ARBORETUM_INLINE vd madd(vd a, vd b, vd c) { return kHasFma ? __builtin_fma(a.v, b.v, c.v) : a.v * b.v + c.v; }
  friend ARBORETUM_INLINE vd msub(vd a, vd b, vd c) { return kHasFma ? __builtin_fma(a.v, b.v, -c.v) : a.v * b.v - c.v; }
  /// `a` with its sign flipped where b's sign bit is set.
  friend ARBORETUM_INLINE vd flip_sign(vd a, vd b) { return a.v * __builtin_copysign(1.0, b.v); }
  friend ARBORETUM_INLINE unsigned operator>=(vd a, vd b) { return a.v >= b.v; }
  friend ARBORETUM_INLINE unsigned operator<(vd a, vd b) { return a.v < b.v; }
  friend ARBORETUM_INLINE unsigned operator!=(vd a, vd b) { return a.v != b.v; }
};

#if ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
template <>
struct vd<2> {
  __m128d v;
  vd() = default;
  ARBORETUM_INLINE explicit vd(__m128d x) : v(x) {}
  ARBORETUM_INLINE vd(double s) : v(_mm_set1_pd(s)) {}
  static ARBORETUM_INLINE vd load(const float* p) {
    return vd(_mm_cvtps_pd(_mm_castsi128_ps(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(p)))));
  }
  ARBORETUM_INLINE void store(float* p) const { _mm_storel_epi64(reinterpret_cast<__m128i*>(p), _mm_castps_si128(_mm_cvtpd_ps(v))); }
  friend ARBORETUM_INLINE vd operator+(vd a, vd b) { return vd(_mm_add_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd operator-(vd a, vd b) { return vd(_mm_sub_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd operator*(vd a, vd b) { return vd(_mm_mul_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd operator/(vd a, vd b) { return vd(_mm_div_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd min_x86(vd a, vd b) { return vd(_mm_min_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd max_x86(vd a, vd b) { return vd(_mm_max_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd madd(vd a, vd b, vd c) { return a * b + c; }
  friend ARBORETUM_INLINE vd msub(vd a, vd b, vd c) { return a * b - c; }
  friend ARBORETUM_INLINE vd flip_sign(vd a, vd b) { return vd(_mm_xor_pd(a.v, _mm_and_pd(b.v, _mm_set1_pd(-0.0)))); }
  friend ARBORETUM_INLINE unsigned operator>=(vd a, vd b) { return unsigned(_mm_movemask_pd(_mm_cmple_pd(b.v, a.v))); }
  friend ARBORETUM_INLINE unsigned operator<(vd a, vd b) { return unsigned(_mm_movemask_pd(_mm_cmplt_pd(a.v, b.v))); }
  friend ARBORETUM_INLINE unsigned operator!=(vd a, vd b) { return unsigned(_mm_movemask_pd(_mm_cmpneq_pd(a.v, b.v))); }
};
#endif

#if ARBORETUM_TARGET >= ARBORETUM_TARGET_AVX2
template <>
struct vd<4> {
  __m256d v;
  vd() = default;
  ARBORETUM_INLINE explicit vd(__m256d x) : v(x) {}
  ARBORETUM_INLINE vd(double s) : v(_mm256_set1_pd(s)) {}
  static ARBORETUM_INLINE vd load(const float* p) { return vd(_mm256_cvtps_pd(_mm_loadu_ps(p))); }
  ARBORETUM_INLINE void store(float* p) const { _mm_storeu_ps(p, _mm256_cvtpd_ps(v)); }
  friend ARBORETUM_INLINE vd operator+(vd a, vd b) { return vd(_mm256_add_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd operator-(vd a, vd b) { return vd(_mm256_sub_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd operator*(vd a, vd b) { return vd(_mm256_mul_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd operator/(vd a, vd b) { return vd(_mm256_div_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd min_x86(vd a, vd b) { return vd(_mm256_min_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd max_x86(vd a, vd b) { return vd(_mm256_max_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd madd(vd a, vd b, vd c) { return vd(_mm256_fmadd_pd(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vd msub(vd a, vd b, vd c) { return vd(_mm256_fmsub_pd(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vd flip_sign(vd a, vd b) { return vd(_mm256_xor_pd(a.v, _mm256_and_pd(b.v, _mm256_set1_pd(-0.0)))); }
  friend ARBORETUM_INLINE unsigned operator>=(vd a, vd b) { return unsigned(_mm256_movemask_pd(_mm256_cmp_pd(a.v, b.v, _CMP_GE_OQ))); }
  friend ARBORETUM_INLINE unsigned operator<(vd a, vd b) { return unsigned(_mm256_movemask_pd(_mm256_cmp_pd(a.v, b.v, _CMP_LT_OQ))); }
  friend ARBORETUM_INLINE unsigned operator!=(vd a, vd b) { return unsigned(_mm256_movemask_pd(_mm256_cmp_pd(a.v, b.v, _CMP_NEQ_UQ))); }
};
#endif

#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
template <>
struct vd<8> {
  __m512d v;
  vd() = default;
  ARBORETUM_INLINE explicit vd(__m512d x) : v(x) {}
  ARBORETUM_INLINE vd(double s) : v(_mm512_set1_pd(s)) {}
  static ARBORETUM_INLINE vd load(const float* p) { return vd(_mm512_cvtps_pd(_mm256_loadu_ps(p))); }
  ARBORETUM_INLINE void store(float* p) const { _mm256_storeu_ps(p, _mm512_cvtpd_ps(v)); }
  friend ARBORETUM_INLINE vd operator+(vd a, vd b) { return vd(_mm512_add_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd operator-(vd a, vd b) { return vd(_mm512_sub_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd operator*(vd a, vd b) { return vd(_mm512_mul_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd operator/(vd a, vd b) { return vd(_mm512_div_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd min_x86(vd a, vd b) { return vd(_mm512_min_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd max_x86(vd a, vd b) { return vd(_mm512_max_pd(a.v, b.v)); }
  friend ARBORETUM_INLINE vd madd(vd a, vd b, vd c) { return vd(_mm512_fmadd_pd(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vd msub(vd a, vd b, vd c) { return vd(_mm512_fmsub_pd(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vd flip_sign(vd a, vd b) { return vd(_mm512_xor_pd(a.v, _mm512_and_pd(b.v, _mm512_set1_pd(-0.0)))); }
  friend ARBORETUM_INLINE unsigned operator>=(vd a, vd b) { return _mm512_cmp_pd_mask(a.v, b.v, _CMP_GE_OQ); }
  friend ARBORETUM_INLINE unsigned operator<(vd a, vd b) { return _mm512_cmp_pd_mask(a.v, b.v, _CMP_LT_OQ); }
  friend ARBORETUM_INLINE unsigned operator!=(vd a, vd b) { return _mm512_cmp_pd_mask(a.v, b.v, _CMP_NEQ_UQ); }
};
#endif

template <int W>
using vd3 = vec3<vd<W>>;
template <int W>
ARBORETUM_INLINE vd<W> abs(vd<W> a) {
  return flip_sign(a, a);
}
/// W floats of each of three arrays, widened.
template <int W>
ARBORETUM_INLINE vd3<W> load3(const float* x, const float* y, const float* z) {
  return {vd<W>::load(x), vd<W>::load(y), vd<W>::load(z)};
}
/// All of them, rounded. In registers where it can be: a load of what two stores have written waits for them.
template <int W, int D>
ARBORETUM_INLINE vf<W> to_floats(const vd<D> (&a)[W / D]) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
  if constexpr (W == 4 && D == 2) return vf<W>(_mm_movelh_ps(_mm_cvtpd_ps(a[0].v), _mm_cvtpd_ps(a[1].v)));
#elif ARBORETUM_TARGET >= ARBORETUM_TARGET_AVX2
  if constexpr (W == 8 && D == 4) return vf<W>(_mm256_set_m128(_mm256_cvtpd_ps(a[1].v), _mm256_cvtpd_ps(a[0].v)));
#endif
  alignas(64) float out[W];
  for (int k = 0; k < W / D; ++k) a[k].store(out + k * D);
  return vf<W>::load(out);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
