// Closes what simd/target_begin.h opened.
#if defined(__clang__)
#if ARBORETUM_TARGET != ARBORETUM_TARGET_SCALAR
#pragma clang attribute pop
#endif
#else
#pragma GCC pop_options
#endif
