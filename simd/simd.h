// W lanes of float (vf), int (vi) and mask (vm), W = 1, 4, 8, 16, on every instruction set.
//
// A width beyond the register is several registers (simd/pair.h). The semantics are the same on every ISA:
//   min_x86(a, b) is a < b ? a : b, so NaN or a tie (+0, -0) gives b; max_x86 likewise with >.
//   < <= > >= == are ordered (false with a NaN), != is unordered (true with a NaN).
//   madd, msub, nmadd are fused exactly where kHasFma; a * b + c never is (-ffp-contract=off).
// Include only between simd/target_begin.h and simd/target_end.h.
#pragma once

#include "simd/target.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <int W>
struct vf;  ///< W floats
template <int W>
struct vi;  ///< W signed 32-bit integers
template <int W>
struct vm;  ///< W truth values

inline constexpr bool kHasFma = ARBORETUM_TARGET >= ARBORETUM_TARGET_AVX2;
/// Float lanes of a register; 1 for scalar.
inline constexpr int kRegisterWidth = ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512 ? 16
                                      : ARBORETUM_TARGET == ARBORETUM_TARGET_AVX2 ? 8
                                      : ARBORETUM_TARGET == ARBORETUM_TARGET_SSE  ? 4
                                                                                  : 1;
/// Lanes of one register; four where there is none.
inline constexpr int kNativeWidth = kRegisterWidth < 4 ? 4 : kRegisterWidth;
/// Lanes in which N things stand: a vector has four at least.
constexpr int lanes_for(int n) { return n < 4 ? 4 : n; }
inline constexpr Isa kIsa = static_cast<Isa>(ARBORETUM_TARGET);

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum

#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
#include "simd/scalar.h"
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
#include "simd/sse.h"
#include "simd/pair.h"
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_AVX2
#include "simd/sse.h"
#include "simd/avx2.h"
#include "simd/pair.h"
#else
#include "simd/avx512.h"
#endif

#include "simd/one.h"
#include "simd/common.h"
