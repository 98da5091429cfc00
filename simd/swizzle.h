// Moving lanes: within groups of four, from one group to all, and bytes in memory to lanes. What nodes need that are not
// plain arrays of floats (bvh4_aos, quantised boxes). Include only between simd/target_begin.h and simd/target_end.h.
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

/// W unsigned bytes at `p`, one a lane.
template <int W>
ARBORETUM_INLINE vi<W> load_bytes(const void* p) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
  const auto* byte = static_cast<const std::uint8_t*>(p);
  return vi<W>::map([&](int i) { return std::int32_t(byte[i]); });
#else
  if constexpr (W == 4) {
    int four;
    std::memcpy(&four, p, sizeof four);
    return vi<W>(_mm_cvtepu8_epi32(_mm_cvtsi32_si128(four)));
  } else {
#if ARBORETUM_TARGET >= ARBORETUM_TARGET_AVX2
    if constexpr (W == 8) return vi<W>(_mm256_cvtepu8_epi32(_mm_loadl_epi64(static_cast<const __m128i*>(p))));
#endif
#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
    if constexpr (W == 16) return vi<W>(_mm512_cvtepu8_epi32(_mm_loadu_si128(static_cast<const __m128i*>(p))));
#endif
    if constexpr (requires(vi<W> b) { b.lo; }) return vi<W>(load_bytes<W / 2>(p), load_bytes<W / 2>(static_cast<const std::uint8_t*>(p) + W / 2));
  }
#endif
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
