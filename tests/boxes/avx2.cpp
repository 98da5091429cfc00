#define ARBORETUM_TARGET ARBORETUM_TARGET_AVX2
#include "traversal/kernel_unit.h"

#include "tests/boxes/box_tests.h"

#include "simd/target_begin.h"
#include "tests/boxes/box_tests_impl.h"
namespace arboretum::box_test {
unsigned meets_avx2(Test test, const Ray& ray, float max_coordinate, const Boxes& boxes) {
  return isa_avx2::meets(test, ray, max_coordinate, boxes);
}
}  // namespace arboretum::box_test
#include "simd/target_end.h"
