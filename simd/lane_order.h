// Lanes in another order, chosen as the program runs: moved to the front, permuted, sorted. On AVX2 and AVX-512, for widths of one
// register. Include only between simd/target_begin.h and simd/target_end.h.
#pragma once

#include "simd/simd.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Whether the functions below exist for W lanes.
template <int W>
inline constexpr bool kOrdersLanes = kRegisterWidth >= 8 && W >= 4 && W <= kRegisterWidth;

#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX2
/// Which lane comes to each place when the lanes of a mask are moved together.
struct CompressTable {
  std::uint64_t lanes[256] = {};
  constexpr CompressTable() {
    for (unsigned m = 0; m < 256; ++m) {
      unsigned n = 0;
      for (unsigned i = 0; i < 8; ++i)
        if (m >> i & 1) lanes[m] |= std::uint64_t(i) << (8 * n++);
    }
  }
};
inline constexpr CompressTable kCompress;
#endif

#if ARBORETUM_TARGET >= ARBORETUM_TARGET_AVX2
/// Lane i of the result is lane `from[i]` of `a`, 0 to W - 1.
ARBORETUM_INLINE vi<4> permute(vi<4> a, vi<4> from) { return vi<4>(_mm_castps_si128(_mm_permutevar_ps(_mm_castsi128_ps(a.v), from.v))); }
ARBORETUM_INLINE vi<8> permute(vi<8> a, vi<8> from) { return vi<8>(_mm256_permutevar8x32_epi32(a.v, from.v)); }

/// The first To lanes, or all of them and zeros.
template <int To, int From>
ARBORETUM_INLINE vi<To> first(vi<From> a) {
  if constexpr (To == From) return a;
  if constexpr (To == 4 && From == 8) return vi<To>(_mm256_castsi256_si128(a.v));
  if constexpr (To == 8 && From == 4) return vi<To>(_mm256_zextsi128_si256(a.v));
#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
  if constexpr (To == 4 && From == 16) return vi<To>(_mm512_castsi512_si128(a.v));
  if constexpr (To == 8 && From == 16) return vi<To>(_mm512_castsi512_si256(a.v));
  if constexpr (To == 16 && From == 4) return vi<To>(_mm512_zextsi128_si512(a.v));
  if constexpr (To == 16 && From == 8) return vi<To>(_mm512_zextsi256_si512(a.v));
#endif
}

#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
ARBORETUM_INLINE vi<16> permute(vi<16> a, vi<16> from) { return vi<16>(_mm512_permutexvar_epi32(from.v, a.v)); }

/// `a`, in the lanes that `m` names with `bits` set.
ARBORETUM_INLINE vi<4> or_where(vm<4> m, vi<4> a, vi<4> bits) { return vi<4>(_mm_mask_or_epi32(a.v, m.v, a.v, bits.v)); }
ARBORETUM_INLINE vi<8> or_where(vm<8> m, vi<8> a, vi<8> bits) { return vi<8>(_mm256_mask_or_epi32(a.v, m.v, a.v, bits.v)); }
ARBORETUM_INLINE vi<16> or_where(vm<16> m, vi<16> a, vi<16> bits) { return vi<16>(_mm512_mask_or_epi32(a.v, m.v, a.v, bits.v)); }
#else
ARBORETUM_INLINE vi<4> or_where(vm<4> m, vi<4> a, vi<4> bits) { return a | (vi<4>(_mm_castps_si128(m.v)) & bits); }
ARBORETUM_INLINE vi<8> or_where(vm<8> m, vi<8> a, vi<8> bits) { return a | (vi<8>(_mm256_castps_si256(m.v)) & bits); }
#endif

/// The lanes whose bit is set, moved to the front in order; the lanes behind them are zero.
template <int W>
ARBORETUM_INLINE vi<W> compress(unsigned bits, vi<W> a) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
  return compress(vm<W>::from_bits(bits), a);
#else
  const __m128i from = _mm_cvtsi64_si128(std::int64_t(kCompress.lanes[bits]));  // as bytes
  const int count = __builtin_popcount(bits);
  if constexpr (W == 4) return permute(a, vi<4>(_mm_cvtepu8_epi32(from))) & vi<4>(_mm_cmpgt_epi32(_mm_set1_epi32(count), vi<4>::iota().v));
  if constexpr (W == 8)
    return permute(a, vi<8>(_mm256_cvtepu8_epi32(from))) & vi<8>(_mm256_cmpgt_epi32(_mm256_set1_epi32(count), vi<8>::iota().v));
#endif
}

/// Lanes i and i ^ X change places where the first of the two is the less.
template <int X>
ARBORETUM_INLINE vi<4> larger_first(vi<4> a) {
  const __m128i other = _mm_shuffle_epi32(a.v, X ^ (1 ^ X) << 2 ^ (2 ^ X) << 4 ^ (3 ^ X) << 6);
  return vi<4>(_mm_blend_epi32(_mm_max_epi32(a.v, other), _mm_min_epi32(a.v, other), X == 1 ? 0b1010 : 0b1100));
}
template <int X>
ARBORETUM_INLINE vi<8> larger_first(vi<8> a) {
  __m256i other = a.v;
  if constexpr (X >= 4) other = _mm256_permute4x64_epi64(other, 0x4e);
  if constexpr ((X & 3) != 0) other = _mm256_shuffle_epi32(other, ((X & 3) ^ (1 ^ (X & 3)) << 2 ^ (2 ^ (X & 3)) << 4 ^ (3 ^ (X & 3)) << 6));
  return vi<8>(_mm256_blend_epi32(_mm256_max_epi32(a.v, other), _mm256_min_epi32(a.v, other),
                                  X == 1  ? 0b10101010
                                  : X < 4 ? 0b11001100
                                          : 0b11110000));
}
#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
template <int X>
ARBORETUM_INLINE vi<16> larger_first(vi<16> a) {
  const vi<16> other = permute(a, vi<16>::iota() ^ vi<16>(X));
  return vi<16>(_mm512_mask_min_epi32(max(a, other).v, X == 1 ? 0xaaaa : X < 4 ? 0xcccc : X < 8 ? 0xf0f0 : 0xff00, a.v, other.v));
}
#endif

/// The largest first: Batcher's bitonic sort (1968), every exchange in the same direction.
template <int W>
ARBORETUM_INLINE vi<W> sort_down(vi<W> a) {
  a = larger_first<1>(larger_first<3>(larger_first<1>(a)));
  if constexpr (W >= 8) a = larger_first<1>(larger_first<2>(larger_first<7>(a)));
  if constexpr (W == 16) a = larger_first<1>(larger_first<2>(larger_first<4>(larger_first<15>(a))));
  return a;
}

/// The same of lanes that are not negative and 0 from `count` on.
template <int W>
ARBORETUM_INLINE vi<W> sort_first_down(vi<W> a, unsigned count) {
  if constexpr (W > 8) {
    if (count > 8) return sort_down(a);
  }
  if constexpr (W > 4) {
    if (count > 4) return first<W>(sort_down(first<8>(a)));
  }
  return first<W>(sort_down(first<4>(a)));
}
#endif

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
