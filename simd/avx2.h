// Eight lanes in a 256-bit register: AVX2 and FMA.
#pragma once

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <>
struct vm<8> {
  __m256 v;
  vm() = default;
  ARBORETUM_INLINE explicit vm(__m256 x) : v(x) {}
  ARBORETUM_INLINE explicit vm(bool all) : v(_mm256_castsi256_ps(_mm256_set1_epi32(all ? -1 : 0))) {}
  static ARBORETUM_INLINE vm from_bits(unsigned bits) {
    const __m256i lane = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
    return vm(_mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(int(bits)), lane), lane)));
  }
  ARBORETUM_INLINE unsigned bits() const { return unsigned(_mm256_movemask_ps(v)); }
  friend ARBORETUM_INLINE vm operator&(vm a, vm b) { return vm(_mm256_and_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vm operator|(vm a, vm b) { return vm(_mm256_or_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vm operator^(vm a, vm b) { return vm(_mm256_xor_ps(a.v, b.v)); }
  friend ARBORETUM_INLINE vm operator~(vm a) { return a ^ vm(true); }
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
  friend ARBORETUM_INLINE vm<8> operator==(vi a, vi b) { return vm<8>(_mm256_castsi256_ps(_mm256_cmpeq_epi32(a.v, b.v))); }
  friend ARBORETUM_INLINE vm<8> operator<(vi a, vi b) { return b > a; }
  friend ARBORETUM_INLINE vm<8> operator>(vi a, vi b) { return vm<8>(_mm256_castsi256_ps(_mm256_cmpgt_epi32(a.v, b.v))); }
  friend ARBORETUM_INLINE vi max(vi a, vi b) { return vi(_mm256_max_epi32(a.v, b.v)); }
  friend ARBORETUM_INLINE vi select(vm<8> m, vi a, vi b) { return vi(_mm256_blendv_epi8(b.v, a.v, _mm256_castps_si256(m.v))); }
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
  friend ARBORETUM_INLINE vf madd(vf a, vf b, vf c) { return vf(_mm256_fmadd_ps(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vf msub(vf a, vf b, vf c) { return vf(_mm256_fmsub_ps(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vf nmadd(vf a, vf b, vf c) { return vf(_mm256_fnmadd_ps(a.v, b.v, c.v)); }
  friend ARBORETUM_INLINE vm<8> operator<(vf a, vf b) { return vm<8>(_mm256_cmp_ps(a.v, b.v, _CMP_LT_OQ)); }
  friend ARBORETUM_INLINE vm<8> operator<=(vf a, vf b) { return vm<8>(_mm256_cmp_ps(a.v, b.v, _CMP_LE_OQ)); }
  friend ARBORETUM_INLINE vm<8> operator>(vf a, vf b) { return b < a; }
  friend ARBORETUM_INLINE vm<8> operator>=(vf a, vf b) { return b <= a; }
  friend ARBORETUM_INLINE vm<8> operator==(vf a, vf b) { return vm<8>(_mm256_cmp_ps(a.v, b.v, _CMP_EQ_OQ)); }
  friend ARBORETUM_INLINE vm<8> operator!=(vf a, vf b) { return vm<8>(_mm256_cmp_ps(a.v, b.v, _CMP_NEQ_UQ)); }
  friend ARBORETUM_INLINE vf select(vm<8> m, vf a, vf b) { return vf(_mm256_blendv_ps(b.v, a.v, m.v)); }
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
ARBORETUM_INLINE vi<8> truncate_to_int(vf<8> a) { return vi<8>(_mm256_cvttps_epi32(a.v)); }

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
