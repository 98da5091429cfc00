// Four, eight and sixteen lanes with mask registers: AVX-512 F, VL, DQ, BW.
#pragma once

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <>
struct vm<4> {
  __mmask8 v;
  vm() = default;
  ARBORETUM_INLINE explicit vm(bool all) : v(all ? 0xfu : 0u) {}
  static ARBORETUM_INLINE vm from_bits(unsigned bits) {
    vm m;
    m.v = static_cast<__mmask8>(bits & 0xfu);
    return m;
  }
  ARBORETUM_INLINE unsigned bits() const { return v; }
  friend ARBORETUM_INLINE vm operator&(vm a, vm b) { return from_bits(unsigned(a.v) & b.v); }
  friend ARBORETUM_INLINE vm operator|(vm a, vm b) { return from_bits(unsigned(a.v) | b.v); }
  friend ARBORETUM_INLINE vm operator^(vm a, vm b) { return from_bits(unsigned(a.v) ^ b.v); }
  friend ARBORETUM_INLINE vm operator~(vm a) { return from_bits(~unsigned(a.v)); }
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
  friend ARBORETUM_INLINE vm<4> operator==(vi a, vi b) { return vm<4>::from_bits(_mm_cmpeq_epi32_mask(a.v, b.v)); }
  friend ARBORETUM_INLINE vm<4> operator<(vi a, vi b) { return vm<4>::from_bits(_mm_cmplt_epi32_mask(a.v, b.v)); }
  friend ARBORETUM_INLINE vm<4> operator>(vi a, vi b) { return b < a; }
  friend ARBORETUM_INLINE vi max(vi a, vi b) { return vi(_mm_max_epi32(a.v, b.v)); }
  friend ARBORETUM_INLINE vi select(vm<4> m, vi a, vi b) { return vi(_mm_mask_blend_epi32(m.v, b.v, a.v)); }
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
  /// max(|a|, |b|).
  friend ARBORETUM_INLINE vf max_abs_in_one(vf a, vf b) { return vf(_mm_range_ps(a.v, b.v, 0b1011)); }
  friend ARBORETUM_INLINE vf madd(vf a, vf b, vf c) { return vf(_mm_fmadd_ps(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vf msub(vf a, vf b, vf c) { return vf(_mm_fmsub_ps(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vf nmadd(vf a, vf b, vf c) { return vf(_mm_fnmadd_ps(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vm<4> operator<(vf a, vf b) { return vm<4>::from_bits(_mm_cmp_ps_mask(a.v, b.v, _CMP_LT_OQ)); }
  friend ARBORETUM_INLINE vm<4> operator<=(vf a, vf b) { return vm<4>::from_bits(_mm_cmp_ps_mask(a.v, b.v, _CMP_LE_OQ)); }
  friend ARBORETUM_INLINE vm<4> operator>(vf a, vf b) { return b < a; }
  friend ARBORETUM_INLINE vm<4> operator>=(vf a, vf b) { return b <= a; }
  friend ARBORETUM_INLINE vm<4> operator==(vf a, vf b) { return vm<4>::from_bits(_mm_cmp_ps_mask(a.v, b.v, _CMP_EQ_OQ)); }
  friend ARBORETUM_INLINE vm<4> operator!=(vf a, vf b) { return vm<4>::from_bits(_mm_cmp_ps_mask(a.v, b.v, _CMP_NEQ_UQ)); }
  friend ARBORETUM_INLINE vf select(vm<4> m, vf a, vf b) { return vf(_mm_mask_blend_ps(m.v, b.v, a.v)); }
  ARBORETUM_INLINE vi<4> as_int() const { return vi<4>(_mm_castps_si128(v)); }
  static ARBORETUM_INLINE vf from_int_bits(vi<4> b) { return vf(_mm_castsi128_ps(b.v)); }
  friend ARBORETUM_INLINE float reduce_min(vf a) {
    const __m128 m = _mm_min_ps(a.v, _mm_movehl_ps(a.v, a.v));
    return _mm_cvtss_f32(_mm_min_ss(m, _mm_shuffle_ps(m, m, 1)));
  }
  friend ARBORETUM_INLINE float reduce_max(vf a) {
    const __m128 m = _mm_max_ps(a.v, _mm_movehl_ps(a.v, a.v));
    return _mm_cvtss_f32(_mm_max_ss(m, _mm_shuffle_ps(m, m, 1)));
  }
};

ARBORETUM_INLINE vf<4> to_float(vi<4> a) { return vf<4>(_mm_cvtepi32_ps(a.v)); }
/// Towards zero; NaN and what does not fit give the smallest integer.
ARBORETUM_INLINE vi<4> truncate_to_int(vf<4> a) { return vi<4>(_mm_cvttps_epi32(a.v)); }
/// The lanes that `m` names, moved to the front in order; the lanes behind them are zero.
ARBORETUM_INLINE vi<4> compress(vm<4> m, vi<4> a) { return vi<4>(_mm_maskz_compress_epi32(m.v, a.v)); }

template <>
struct vm<8> {
  __mmask8 v;
  vm() = default;
  ARBORETUM_INLINE explicit vm(bool all) : v(all ? 0xffu : 0u) {}
  static ARBORETUM_INLINE vm from_bits(unsigned bits) {
    vm m;
    m.v = static_cast<__mmask8>(bits & 0xffu);
    return m;
  }
  ARBORETUM_INLINE unsigned bits() const { return v; }
  friend ARBORETUM_INLINE vm operator&(vm a, vm b) { return from_bits(unsigned(a.v) & b.v); }
  friend ARBORETUM_INLINE vm operator|(vm a, vm b) { return from_bits(unsigned(a.v) | b.v); }
  friend ARBORETUM_INLINE vm operator^(vm a, vm b) { return from_bits(unsigned(a.v) ^ b.v); }
  friend ARBORETUM_INLINE vm operator~(vm a) { return from_bits(~unsigned(a.v)); }
};

template <>
struct vi<8> {
  __m256i v;
  vi() = default;
  ARBORETUM_INLINE explicit vi(__m256i x) : v(x) {}
  ARBORETUM_INLINE vi(std::int32_t s) : v(_mm256_set1_epi32(s)) {}
  static ARBORETUM_INLINE vi load(const void* p) { return vi(_mm256_loadu_si256(static_cast<const __m256i*>(p))); }
  static ARBORETUM_INLINE vi iota() { return vi(_mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7)); }
  ARBORETUM_INLINE void store(void* p) const { _mm256_storeu_si256(static_cast<__m256i*>(p), v); }
  friend ARBORETUM_INLINE vi operator+(vi a, vi b) { return vi(_mm256_add_epi32(a.v, b.v)); }
  friend ARBORETUM_INLINE vi operator-(vi a, vi b) { return vi(_mm256_sub_epi32(a.v, b.v)); }
  friend ARBORETUM_INLINE vi operator&(vi a, vi b) { return vi(_mm256_and_si256(a.v, b.v)); }
  friend ARBORETUM_INLINE vi operator|(vi a, vi b) { return vi(_mm256_or_si256(a.v, b.v)); }
  friend ARBORETUM_INLINE vi operator^(vi a, vi b) { return vi(_mm256_xor_si256(a.v, b.v)); }
  friend ARBORETUM_INLINE vm<8> operator==(vi a, vi b) { return vm<8>::from_bits(_mm256_cmpeq_epi32_mask(a.v, b.v)); }
  friend ARBORETUM_INLINE vm<8> operator<(vi a, vi b) { return vm<8>::from_bits(_mm256_cmplt_epi32_mask(a.v, b.v)); }
  friend ARBORETUM_INLINE vm<8> operator>(vi a, vi b) { return b < a; }
  friend ARBORETUM_INLINE vi max(vi a, vi b) { return vi(_mm256_max_epi32(a.v, b.v)); }
  friend ARBORETUM_INLINE vi select(vm<8> m, vi a, vi b) { return vi(_mm256_mask_blend_epi32(m.v, b.v, a.v)); }
  template <int S>
  ARBORETUM_INLINE vi shift_left() const {
    return vi(_mm256_slli_epi32(v, S));
  }
};

template <>
struct vf<8> {
  __m256 v;
  vf() = default;
  ARBORETUM_INLINE explicit vf(__m256 x) : v(x) {}
  ARBORETUM_INLINE vf(float s) : v(_mm256_set1_ps(s)) {}
  static ARBORETUM_INLINE vf load(const void* p) { return vf(_mm256_loadu_ps(static_cast<const float*>(p))); }
  ARBORETUM_INLINE void store(void* p) const { _mm256_storeu_ps(static_cast<float*>(p), v); }
  friend ARBORETUM_INLINE vf operator+(vf a, vf b) { return vf(_mm256_add_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vf operator-(vf a, vf b) { return vf(_mm256_sub_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vf operator*(vf a, vf b) { return vf(_mm256_mul_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vf operator/(vf a, vf b) { return vf(_mm256_div_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vf min_x86(vf a, vf b) { return vf(_mm256_min_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vf max_x86(vf a, vf b) { return vf(_mm256_max_ps(a.v, b.v)); }
  /// max(|a|, |b|).
  friend ARBORETUM_INLINE vf max_abs_in_one(vf a, vf b) { return vf(_mm256_range_ps(a.v, b.v, 0b1011)); }
  friend ARBORETUM_INLINE vf madd(vf a, vf b, vf c) { return vf(_mm256_fmadd_ps(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vf msub(vf a, vf b, vf c) { return vf(_mm256_fmsub_ps(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vf nmadd(vf a, vf b, vf c) { return vf(_mm256_fnmadd_ps(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vm<8> operator<(vf a, vf b) { return vm<8>::from_bits(_mm256_cmp_ps_mask(a.v, b.v, _CMP_LT_OQ)); }
  friend ARBORETUM_INLINE vm<8> operator<=(vf a, vf b) { return vm<8>::from_bits(_mm256_cmp_ps_mask(a.v, b.v, _CMP_LE_OQ)); }
  friend ARBORETUM_INLINE vm<8> operator>(vf a, vf b) { return b < a; }
  friend ARBORETUM_INLINE vm<8> operator>=(vf a, vf b) { return b <= a; }
  friend ARBORETUM_INLINE vm<8> operator==(vf a, vf b) { return vm<8>::from_bits(_mm256_cmp_ps_mask(a.v, b.v, _CMP_EQ_OQ)); }
  friend ARBORETUM_INLINE vm<8> operator!=(vf a, vf b) { return vm<8>::from_bits(_mm256_cmp_ps_mask(a.v, b.v, _CMP_NEQ_UQ)); }
  friend ARBORETUM_INLINE vf select(vm<8> m, vf a, vf b) { return vf(_mm256_mask_blend_ps(m.v, b.v, a.v)); }
  ARBORETUM_INLINE vi<8> as_int() const { return vi<8>(_mm256_castps_si256(v)); }
  static ARBORETUM_INLINE vf from_int_bits(vi<8> b) { return vf(_mm256_castsi256_ps(b.v)); }
  friend ARBORETUM_INLINE float reduce_min(vf a) {
    return reduce_min(vf<4>(_mm_min_ps(_mm256_castps256_ps128(a.v), _mm256_extractf128_ps(a.v, 1))));
  }
  friend ARBORETUM_INLINE float reduce_max(vf a) {
    return reduce_max(vf<4>(_mm_max_ps(_mm256_castps256_ps128(a.v), _mm256_extractf128_ps(a.v, 1))));
  }
};

ARBORETUM_INLINE vf<8> to_float(vi<8> a) { return vf<8>(_mm256_cvtepi32_ps(a.v)); }
/// Towards zero; NaN and what does not fit give the smallest integer.
ARBORETUM_INLINE vi<8> truncate_to_int(vf<8> a) { return vi<8>(_mm256_cvttps_epi32(a.v)); }
/// The lanes that `m` names, moved to the front in order; the lanes behind them are zero.
ARBORETUM_INLINE vi<8> compress(vm<8> m, vi<8> a) { return vi<8>(_mm256_maskz_compress_epi32(m.v, a.v)); }

template <>
struct vm<16> {
  __mmask16 v;
  vm() = default;
  ARBORETUM_INLINE explicit vm(bool all) : v(all ? 0xffffu : 0u) {}
  static ARBORETUM_INLINE vm from_bits(unsigned bits) {
    vm m;
    m.v = static_cast<__mmask16>(bits & 0xffffu);
    return m;
  }
  ARBORETUM_INLINE unsigned bits() const { return v; }
  friend ARBORETUM_INLINE vm operator&(vm a, vm b) { return from_bits(unsigned(a.v) & b.v); }
  friend ARBORETUM_INLINE vm operator|(vm a, vm b) { return from_bits(unsigned(a.v) | b.v); }
  friend ARBORETUM_INLINE vm operator^(vm a, vm b) { return from_bits(unsigned(a.v) ^ b.v); }
  friend ARBORETUM_INLINE vm operator~(vm a) { return from_bits(~unsigned(a.v)); }
};

template <>
struct vi<16> {
  __m512i v;
  vi() = default;
  ARBORETUM_INLINE explicit vi(__m512i x) : v(x) {}
  ARBORETUM_INLINE vi(std::int32_t s) : v(_mm512_set1_epi32(s)) {}
  static ARBORETUM_INLINE vi load(const void* p) { return vi(_mm512_loadu_si512(static_cast<const __m512i*>(p))); }
  static ARBORETUM_INLINE vi iota() { return vi(_mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)); }
  ARBORETUM_INLINE void store(void* p) const { _mm512_storeu_si512(static_cast<__m512i*>(p), v); }
  friend ARBORETUM_INLINE vi operator+(vi a, vi b) { return vi(_mm512_add_epi32(a.v, b.v)); }
  friend ARBORETUM_INLINE vi operator-(vi a, vi b) { return vi(_mm512_sub_epi32(a.v, b.v)); }
  friend ARBORETUM_INLINE vi operator&(vi a, vi b) { return vi(_mm512_and_epi32(a.v, b.v)); }
  friend ARBORETUM_INLINE vi operator|(vi a, vi b) { return vi(_mm512_or_epi32(a.v, b.v)); }
  friend ARBORETUM_INLINE vi operator^(vi a, vi b) { return vi(_mm512_xor_epi32(a.v, b.v)); }
  friend ARBORETUM_INLINE vm<16> operator==(vi a, vi b) { return vm<16>::from_bits(_mm512_cmpeq_epi32_mask(a.v, b.v)); }
  friend ARBORETUM_INLINE vm<16> operator<(vi a, vi b) { return vm<16>::from_bits(_mm512_cmplt_epi32_mask(a.v, b.v)); }
  friend ARBORETUM_INLINE vm<16> operator>(vi a, vi b) { return b < a; }
  friend ARBORETUM_INLINE vi max(vi a, vi b) { return vi(_mm512_max_epi32(a.v, b.v)); }
  friend ARBORETUM_INLINE vi select(vm<16> m, vi a, vi b) { return vi(_mm512_mask_blend_epi32(m.v, b.v, a.v)); }
  template <int S>
  ARBORETUM_INLINE vi shift_left() const {
    return vi(_mm512_slli_epi32(v, S));
  }
};

template <>
struct vf<16> {
  __m512 v;
  vf() = default;
  ARBORETUM_INLINE explicit vf(__m512 x) : v(x) {}
  ARBORETUM_INLINE vf(float s) : v(_mm512_set1_ps(s)) {}
  static ARBORETUM_INLINE vf load(const void* p) { return vf(_mm512_loadu_ps(static_cast<const float*>(p))); }
  ARBORETUM_INLINE void store(void* p) const { _mm512_storeu_ps(static_cast<float*>(p), v); }
  friend ARBORETUM_INLINE vf operator+(vf a, vf b) { return vf(_mm512_add_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vf operator-(vf a, vf b) { return vf(_mm512_sub_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vf operator*(vf a, vf b) { return vf(_mm512_mul_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vf operator/(vf a, vf b) { return vf(_mm512_div_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vf min_x86(vf a, vf b) { return vf(_mm512_min_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vf max_x86(vf a, vf b) { return vf(_mm512_max_ps(a.v, b.v)); }
  /// max(|a|, |b|).
  friend ARBORETUM_INLINE vf max_abs_in_one(vf a, vf b) { return vf(_mm512_range_ps(a.v, b.v, 0b1011)); }
  friend ARBORETUM_INLINE vf madd(vf a, vf b, vf c) { return vf(_mm512_fmadd_ps(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vf msub(vf a, vf b, vf c) { return vf(_mm512_fmsub_ps(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vf nmadd(vf a, vf b, vf c) { return vf(_mm512_fnmadd_ps(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vm<16> operator<(vf a, vf b) { return vm<16>::from_bits(_mm512_cmp_ps_mask(a.v, b.v, _CMP_LT_OQ)); }
  friend ARBORETUM_INLINE vm<16> operator<=(vf a, vf b) { return vm<16>::from_bits(_mm512_cmp_ps_mask(a.v, b.v, _CMP_LE_OQ)); }
  friend ARBORETUM_INLINE vm<16> operator>(vf a, vf b) { return b < a; }
  friend ARBORETUM_INLINE vm<16> operator>=(vf a, vf b) { return b <= a; }
  friend ARBORETUM_INLINE vm<16> operator==(vf a, vf b) { return vm<16>::from_bits(_mm512_cmp_ps_mask(a.v, b.v, _CMP_EQ_OQ)); }
  friend ARBORETUM_INLINE vm<16> operator!=(vf a, vf b) { return vm<16>::from_bits(_mm512_cmp_ps_mask(a.v, b.v, _CMP_NEQ_UQ)); }
  friend ARBORETUM_INLINE vf select(vm<16> m, vf a, vf b) { return vf(_mm512_mask_blend_ps(m.v, b.v, a.v)); }
  ARBORETUM_INLINE vi<16> as_int() const { return vi<16>(_mm512_castps_si512(v)); }
  static ARBORETUM_INLINE vf from_int_bits(vi<16> b) { return vf(_mm512_castsi512_ps(b.v)); }
  friend ARBORETUM_INLINE float reduce_min(vf a) {
    return reduce_min(vf<8>(_mm256_min_ps(_mm512_castps512_ps256(a.v), _mm512_extractf32x8_ps(a.v, 1))));
  }
  friend ARBORETUM_INLINE float reduce_max(vf a) {
    return reduce_max(vf<8>(_mm256_max_ps(_mm512_castps512_ps256(a.v), _mm512_extractf32x8_ps(a.v, 1))));
  }
};

ARBORETUM_INLINE vf<16> to_float(vi<16> a) { return vf<16>(_mm512_cvtepi32_ps(a.v)); }
/// Towards zero; NaN and what does not fit give the smallest integer.
ARBORETUM_INLINE vi<16> truncate_to_int(vf<16> a) { return vi<16>(_mm512_cvttps_epi32(a.v)); }
/// The lanes that `m` names, moved to the front in order; the lanes behind them are zero.
ARBORETUM_INLINE vi<16> compress(vm<16> m, vi<16> a) { return vi<16>(_mm512_maskz_compress_epi32(m.v, a.v)); }

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
