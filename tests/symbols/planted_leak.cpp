// What check_symbols.py must find: an inline function outside the ISA's namespace, compiled for AVX2.
#include <immintrin.h>

#define ARBORETUM_TARGET ARBORETUM_TARGET_AVX2
#include "simd/target.h"
#include "simd/target_begin.h"

inline __attribute__((noinline)) float planted_leak(const float* p) {
  return _mm256_cvtss_f32(_mm256_add_ps(_mm256_loadu_ps(p), _mm256_loadu_ps(p + 8)));
}

namespace arboretum::ARBORETUM_ISA_NAMESPACE {
float uses_planted_leak(const float* p) { return planted_leak(p); }
inline __attribute__((noinline)) float kept_inside(const float* p) {
  return _mm256_cvtss_f32(_mm256_mul_ps(_mm256_loadu_ps(p), _mm256_loadu_ps(p + 8)));
}
float uses_kept_inside(const float* p) { return kept_inside(p); }
}  // namespace arboretum::ARBORETUM_ISA_NAMESPACE

#include "simd/target_end.h"
