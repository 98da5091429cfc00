// Four lanes in a 128-bit register: SSE4.2, and AVX2's own encoding of it.
#pragma once

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <>
struct vm<4> {
  __m128 v;
  vm() = default;
  ARBORETUM_INLINE explicit vm(__m128 x) : v(x) {}
  ARBORETUM_INLINE explicit vm(bool all) : v(_mm_castsi128_ps(_mm_set1_epi32(all ? -1 : 0))) {}
  static ARBORETUM_INLINE vm from_bits(unsigned bits) {
    const __m128i lane = _mm_setr_epi32(1, 2, 4, 8);
    return vm(_mm_castsi128_ps(_mm_cmpeq_epi32(_mm_and_si128(_mm_set1_epi32(int(bits)), lane), lane)));
  }
  ARBORETUM_INLINE unsigned bits() const { return unsigned(_mm_movemask_ps(v)); }
  friend ARBORETUM_INLINE vm operator&(vm a, vm b) { return vm(_mm_and_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vm operator|(vm a, vm b) { return vm(_mm_or_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vm operator^(vm a, vm b) { return vm(_mm_xor_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vm operator~(vm a) { return a ^ vm(true); }
};

template <>
struct vi<4> {
  __m128i v;
  vi() = default;
  ARBORETUM_INLINE explicit vi(__m128i x) : v(x) {}
  ARBORETUM_INLINE vi(std::int32_t s) : v(_mm_set1_epi32(s)) {}
  static ARBORETUM_INLINE vi load(const void* p) { return vi(_mm_loadu_si128(static_cast<const __m128i*>(p))); }
  static ARBORETUM_INLINE vi iota() { return vi(_mm_setr_epi32(0, 1, 2, 3)); }
  ARBORETUM_INLINE void store(void* p) const { _mm_storeu_si128(static_cast<__m128i*>(p), v); }
  friend ARBORETUM_INLINE vi operator+(vi a, vi b) { return vi(_mm_add_epi32(a.v, b.v)); }
  friend ARBORETUM_INLINE vi operator-(vi a, vi b) { return vi(_mm_sub_epi32(a.v, b.v)); }
  friend ARBORETUM_INLINE vi operator&(vi a, vi b) { return vi(_mm_and_si128(a.v, b.v)); }
  friend ARBORETUM_INLINE vi operator|(vi a, vi b) { return vi(_mm_or_si128(a.v, b.v)); }
  friend ARBORETUM_INLINE vi operator^(vi a, vi b) { return vi(_mm_xor_si128(a.v, b.v)); }
  friend ARBORETUM_INLINE vm<4> operator==(vi a, vi b) { return vm<4>(_mm_castsi128_ps(_mm_cmpeq_epi32(a.v, b.v))); }
  friend ARBORETUM_INLINE vm<4> operator<(vi a, vi b) { return vm<4>(_mm_castsi128_ps(_mm_cmplt_epi32(a.v, b.v))); }
  friend ARBORETUM_INLINE vm<4> operator>(vi a, vi b) { return b < a; }
  friend ARBORETUM_INLINE vi max(vi a, vi b) { return vi(_mm_max_epi32(a.v, b.v)); }
  friend ARBORETUM_INLINE vi select(vm<4> m, vi a, vi b) { return vi(_mm_blendv_epi8(b.v, a.v, _mm_castps_si128(m.v))); }
  template <int S>
  ARBORETUM_INLINE vi shift_left() const {
    return vi(_mm_slli_epi32(v, S));
  }
};

template <>
struct vf<4> {
  __m128 v;
  vf() = default;
  ARBORETUM_INLINE explicit vf(__m128 x) : v(x) {}
  ARBORETUM_INLINE vf(float s) : v(_mm_set1_ps(s)) {}
  static ARBORETUM_INLINE vf load(const void* p) { return vf(_mm_loadu_ps(static_cast<const float*>(p))); }
  ARBORETUM_INLINE void store(void* p) const { _mm_storeu_ps(static_cast<float*>(p), v); }
  friend ARBORETUM_INLINE vf operator+(vf a, vf b) { return vf(_mm_add_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vf operator-(vf a, vf b) { return vf(_mm_sub_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vf operator*(vf a, vf b) { return vf(_mm_mul_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vf operator/(vf a, vf b) { return vf(_mm_div_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vf min_x86(vf a, vf b) { return vf(_mm_min_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vf max_x86(vf a, vf b) { return vf(_mm_max_ps(a.v, b.v)); }
#if ARBORETUM_TARGET >= ARBORETUM_TARGET_AVX2
  friend ARBORETUM_INLINE vf madd(vf a, vf b, vf c) { return vf(_mm_fmadd_ps(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vf msub(vf a, vf b, vf c) { return vf(_mm_fmsub_ps(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vf nmadd(vf a, vf b, vf c) { return vf(_mm_fnmadd_ps(a.v, b.v, c.v)); }
#else
  friend ARBORETUM_INLINE vf madd(vf a, vf b, vf c) { return a * b + c; }
  friend ARBORETUM_INLINE vf msub(vf a, vf b, vf c) { return a * b - c; }
  friend ARBORETUM_INLINE vf nmadd(vf a, vf b, vf c) { return c - a * b; }
#endif
  friend ARBORETUM_INLINE vm<4> operator<(vf a, vf b) { return vm<4>(_mm_cmplt_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vm<4> operator<=(vf a, vf b) { return vm<4>(_mm_cmple_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vm<4> operator>(vf a, vf b) { return b < a; }
  friend ARBORETUM_INLINE vm<4> operator>=(vf a, vf b) { return b <= a; }
  friend ARBORETUM_INLINE vm<4> operator==(vf a, vf b) { return vm<4>(_mm_cmpeq_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vm<4> operator!=(vf a, vf b) { return vm<4>(_mm_cmpneq_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vf select(vm<4> m, vf a, vf b) { return vf(_mm_blendv_ps(b.v, a.v, m.v)); }
  ARBORETUM_INLINE vi<4> as_int() const { return vi<4>(_mm_castps_si128(v)); }
  static ARBORETUM_INLINE vf from_int_bits(vi<4> b) { return vf(_mm_castsi128_ps(b.v)); }
  friend ARBORETUM_INLINE float reduce_min(vf a) {
    __m128 m = _mm_min_ps(a.v, _mm_movehl_ps(a.v, a.v));
    return _mm_cvtss_f32(_mm_min_ss(m, _mm_shuffle_ps(m, m, 1)));
  }
  friend ARBORETUM_INLINE float reduce_max(vf a) {
    __m128 m = _mm_max_ps(a.v, _mm_movehl_ps(a.v, a.v));
    return _mm_cvtss_f32(_mm_max_ss(m, _mm_shuffle_ps(m, m, 1)));
  }
};

ARBORETUM_INLINE vf<4> to_float(vi<4> a) { return vf<4>(_mm_cvtepi32_ps(a.v)); }
/// Towards zero; NaN and what does not fit give the smallest integer.
ARBORETUM_INLINE vi<4> truncate_to_int(vf<4> a) { return vi<4>(_mm_cvttps_epi32(a.v)); }

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
