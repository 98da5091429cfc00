// The instruction set of this translation unit, chosen by a stub that defines ARBORETUM_TARGET before including it.
//
// A kernel unit includes every standard and baseline header first, then simd/target_begin.h, then the kernels, then
// simd/target_end.h. What lies between is compiled for the ISA and lives in a namespace of its own, so that no inline
// function compiled for AVX-512 can be merged by the linker into baseline code (tests/symbols/check_symbols.py).
#pragma once

#define ARBORETUM_TARGET_SCALAR 0
#define ARBORETUM_TARGET_SSE 1
#define ARBORETUM_TARGET_AVX2 2
#define ARBORETUM_TARGET_AVX512 3

#ifndef ARBORETUM_TARGET
#error "define ARBORETUM_TARGET as one of ARBORETUM_TARGET_SCALAR, _SSE, _AVX2, _AVX512"
#endif

#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
#define ARBORETUM_ISA_NAMESPACE isa_scalar
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
#define ARBORETUM_ISA_NAMESPACE isa_sse
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_AVX2
#define ARBORETUM_ISA_NAMESPACE isa_avx2
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
#define ARBORETUM_ISA_NAMESPACE isa_avx512
#else
#error "unknown ARBORETUM_TARGET"
#endif

#define ARBORETUM_INLINE inline __attribute__((always_inline))
