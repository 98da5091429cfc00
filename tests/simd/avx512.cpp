#include <immintrin.h>

#include <cstdint>
#include <cstring>
#include <limits>

#include "core/isa.h"
#include "tests/simd/operations.h"

#define ARBORETUM_TARGET ARBORETUM_TARGET_AVX512
#include "simd/target.h"
#include "simd/target_begin.h"
#include "tests/simd/operations_impl.h"
#include "simd/target_end.h"

namespace arboretum::simd_test {
OperationTable operations_avx512(int width) { return isa_avx512::test::table_of(width); }
}  // namespace arboretum::simd_test
