// Moving lanes: within groups of four, from one group to all. What is not plain arrays of floats needs it (bvh4_aos and
// its leaves, rays in memory). Include only between simd/target_begin.h and simd/target_end.h.
#pragma once

#include "simd/simd.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// In each group of four lanes, lane k of the result is lane Ik of `a`.
template <int I0, int I1, int I2, int I3, int W>
ARBORETUM_INLINE vf<W> permute_in_fours(vf<W> a) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
  constexpr int from[4] = {I0, I1, I2, I3};
  return vf<W>::map([&](int i) { return a.lane[(i & ~3) + from[i & 3]]; });
#else
  constexpr int kOrder = I0 | I1 << 2 | I2 << 4 | I3 << 6;
  if constexpr (W == 4) {
    return vf<W>(_mm_shuffle_ps(a.v, a.v, kOrder));
  } else {
#if ARBORETUM_TARGET >= ARBORETUM_TARGET_AVX2
    if constexpr (W == 8) return vf<W>(_mm256_permute_ps(a.v, kOrder));
#endif
#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
    if constexpr (W == 16) return vf<W>(_mm512_permute_ps(a.v, kOrder));
#endif
    if constexpr (requires { a.lo; }) return vf<W>(permute_in_fours<I0, I1, I2, I3>(a.lo), permute_in_fours<I0, I1, I2, I3>(a.hi));
  }
#endif
}

#if ARBORETUM_TARGET != ARBORETUM_TARGET_AVX512
/// op(op(x, z), op(y, w)) of each group x y z w, in order of the groups; `op` takes two vf<4> or two registers' worth.
template <class Op>
ARBORETUM_INLINE vf<4> reduce_fours(vf<16> a, Op op) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
  const auto lanes = [&a](int k) { return vf<4>::map([&](int i) { return a.lane[4 * i + k]; }); };
  return op(op(lanes(0), lanes(2)), op(lanes(1), lanes(3)));
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
  const auto halves = [&op](vf<8> two) {  // xz0 xz1 yw0 yw1
    return op(vf<4>(_mm_unpacklo_ps(two.lo.v, two.hi.v)), vf<4>(_mm_unpackhi_ps(two.lo.v, two.hi.v)));
  };
  const vf<4> low = halves(a.lo), high = halves(a.hi);
  return op(vf<4>(_mm_movelh_ps(low.v, high.v)), vf<4>(_mm_movehl_ps(high.v, low.v)));
#else
  // xz0 xz2 yw0 yw2, xz1 xz3 yw1 yw3
  const vf<8> both = op(vf<8>(_mm256_unpacklo_ps(a.lo.v, a.hi.v)), vf<8>(_mm256_unpackhi_ps(a.lo.v, a.hi.v)));
  const __m128 even = _mm256_castps256_ps128(both.v), odd = _mm256_extractf128_ps(both.v, 1);
  return op(vf<4>(_mm_unpacklo_ps(even, odd)), vf<4>(_mm_unpackhi_ps(even, odd)));
#endif
}
#endif

/// The first lane of each group.
ARBORETUM_INLINE vf<4> first_of_fours(vf<16> a) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
  return vf<4>::map([&](int i) { return a.lane[4 * i]; });
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
  return vf<4>(_mm_movelh_ps(_mm_unpacklo_ps(a.lo.lo.v, a.lo.hi.v), _mm_unpacklo_ps(a.hi.lo.v, a.hi.hi.v)));
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_AVX2
  const __m256 both = _mm256_unpacklo_ps(a.lo.v, a.hi.v);  // x0 x2 y0 y2, x1 x3 y1 y3
  return vf<4>(_mm_unpacklo_ps(_mm256_castps256_ps128(both), _mm256_extractf128_ps(both, 1)));
#else
  const __m512i first = _mm512_castsi128_si512(_mm_setr_epi32(0, 4, 8, 12));
  return vf<4>(_mm512_castps512_ps128(_mm512_permutexvar_ps(first, a.v)));
#endif
}

/// The four lanes of `a` again and again.
template <int W>
ARBORETUM_INLINE vf<W> repeat_four(vf<4> a) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
  return vf<W>::map([&](int i) { return a.lane[i & 3]; });
#else
  if constexpr (W == 4) {
    return a;
  } else {
#if ARBORETUM_TARGET >= ARBORETUM_TARGET_AVX2
    if constexpr (W == 8) return vf<W>(_mm256_set_m128(a.v, a.v));
#endif
#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
    if constexpr (W == 16) return vf<W>(_mm512_broadcast_f32x4(a.v));
#endif
    if constexpr (requires(vf<W> b) { b.lo; }) return vf<W>(repeat_four<W / 2>(a), repeat_four<W / 2>(a));
  }
#endif
}
ARBORETUM_INLINE vf<4> four(float x, float y, float z, float w) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
  const float lanes[4] = {x, y, z, w};
  return vf<4>::load(lanes);
#else
  return vf<4>(_mm_setr_ps(x, y, z, w));
#endif
}

#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
/// Sixteen lanes in halves, the lower of one thing, the upper of another.
ARBORETUM_INLINE vf<16> in_halves(vf<8> low, vf<8> high) { return vf<16>(_mm512_insertf32x8(_mm512_castps256_ps512(low.v), high.v, 1)); }
ARBORETUM_INLINE vf<16> in_halves(float low, float high) {
  return vf<16>(_mm512_mask_blend_ps(0xff00, _mm512_set1_ps(low), _mm512_set1_ps(high)));
}
ARBORETUM_INLINE vf<16> in_both_halves(vf<8> a) { return vf<16>(_mm512_broadcast_f32x8(a.v)); }
ARBORETUM_INLINE vf<8> lower_half(vf<16> a) { return vf<8>(_mm512_castps512_ps256(a.v)); }
ARBORETUM_INLINE vf<8> upper_half(vf<16> a) { return vf<8>(_mm512_extractf32x8_ps(a.v, 1)); }
#endif

/// x y z x of x y z w: where w, which may be anything, would be reckoned with.
ARBORETUM_INLINE vf<4> xyzx(vf<4> a) { return permute_in_fours<0, 1, 2, 0>(a); }

/// N floats in the first lanes, 0 in the others: what stands behind them in memory may be subnormal numbers as floats,
/// and multiplying these takes Intel's cores some 150 cycles, whether anybody looks at those lanes or not.
template <int N>
ARBORETUM_INLINE vf<lanes_for(N)> load_first(const void* p) {
  if constexpr (N == lanes_for(N)) {
    return vf<N>::load(p);
  } else {
    static_assert(N == 2);
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
    float lanes[4] = {};
    std::memcpy(lanes, p, N * sizeof(float));
    return vf<4>::load(lanes);
#else
    return vf<4>(_mm_castsi128_ps(_mm_loadl_epi64(static_cast<const __m128i*>(p))));
#endif
  }
}

/// op over the lanes of `a` that are equal modulo four.
template <int W, class Op>
ARBORETUM_INLINE vf<4> fold_to_four(vf<W> a, Op op) {
  if constexpr (W == 4) {
    return a;
  } else {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
    vf<4> all = vf<4>::load(a.lane);
    for (int k = 4; k < W; k += 4) all = op(all, vf<4>::load(a.lane + k));
    return all;
#else
#if ARBORETUM_TARGET >= ARBORETUM_TARGET_AVX2
    if constexpr (W == 8) return op(vf<4>(_mm256_castps256_ps128(a.v)), vf<4>(_mm256_extractf128_ps(a.v, 1)));
#endif
#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
    if constexpr (W == 16) return fold_to_four(op(lower_half(a), upper_half(a)), op);
#endif
    if constexpr (requires { a.lo; }) return fold_to_four(op(a.lo, a.hi), op);
#endif
  }
}

/// Rows to columns: lane k of row i becomes lane i of row k.
ARBORETUM_INLINE void transpose(vf<4> (&row)[4]) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
  float from[4][4], to[4][4];
  for (int i = 0; i < 4; ++i) row[i].store(from[i]);
  for (int i = 0; i < 4; ++i)
    for (int k = 0; k < 4; ++k) to[k][i] = from[i][k];
  for (int i = 0; i < 4; ++i) row[i] = vf<4>::load(to[i]);
#else
  const __m128 a = _mm_unpacklo_ps(row[0].v, row[1].v), b = _mm_unpackhi_ps(row[0].v, row[1].v);
  const __m128 c = _mm_unpacklo_ps(row[2].v, row[3].v), d = _mm_unpackhi_ps(row[2].v, row[3].v);
  row[0].v = _mm_movelh_ps(a, c), row[1].v = _mm_movehl_ps(c, a), row[2].v = _mm_movelh_ps(b, d), row[3].v = _mm_movehl_ps(d, b);
#endif
}

/// 64 bytes in registers, to be asked which of them have a bit.
class SixtyFourBytes {
 public:
  ARBORETUM_INLINE explicit SixtyFourBytes(const std::uint8_t* bytes) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
    std::memcpy(v_, bytes, sizeof v_);
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
    for (int i = 0; i < 4; ++i) v_[i] = _mm_loadu_si128(reinterpret_cast<const __m128i*>(bytes) + i);
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_AVX2
    for (int i = 0; i < 2; ++i) v_[i] = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(bytes) + i);
#else
    v_[0] = _mm512_loadu_si512(bytes);
#endif
  }
  /// Bit i of the result: whether byte i has bit `bit`, 0 to 7.
  [[nodiscard]] ARBORETUM_INLINE std::uint64_t with_bit(int bit) const {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
    std::uint64_t all = 0;
    for (int i = 0; i < 64; ++i) all |= std::uint64_t(v_[i] >> bit & 1) << i;
    return all;
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
    return _mm512_test_epi8_mask(v_[0], _mm512_set1_epi8(char(1 << bit)));
#else
    const __m128i up = _mm_cvtsi32_si128(7 - bit);  // the bit becomes each byte's sign
    std::uint64_t all = 0;
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
    for (int i = 0; i < 4; ++i) all |= std::uint64_t(unsigned(_mm_movemask_epi8(_mm_sll_epi16(v_[i], up)))) << (16 * i);
#else
    for (int i = 0; i < 2; ++i) all |= std::uint64_t(unsigned(_mm256_movemask_epi8(_mm256_sll_epi16(v_[i], up)))) << (32 * i);
#endif
    return all;
#endif
  }

 private:
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
  std::uint8_t v_[64];
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
  __m128i v_[4];
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_AVX2
  __m256i v_[2];
#else
  __m512i v_[1];
#endif
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
