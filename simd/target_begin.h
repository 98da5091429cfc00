// Opens the code of one ISA; no include guard, since every kernel unit opens and closes it once. See simd/target.h.
#if defined(__clang__)
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
#pragma clang attribute push(__attribute__((target("sse4.2,popcnt"))), apply_to = function)
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_AVX2
#pragma clang attribute push(__attribute__((target("avx2,fma,bmi,bmi2,lzcnt,popcnt"))), apply_to = function)
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
#pragma clang attribute push(__attribute__((target("avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi,bmi2,lzcnt,popcnt"))), \
                             apply_to = function)
#endif
#else
#pragma GCC push_options
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
#pragma GCC target("sse4.2,popcnt")
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_AVX2
#pragma GCC target("avx2,fma,bmi,bmi2,lzcnt,popcnt")
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
#pragma GCC target("avx512f,avx512vl,avx512dq,avx512bw,avx2,fma,bmi,bmi2,lzcnt,popcnt")
#endif
#endif
