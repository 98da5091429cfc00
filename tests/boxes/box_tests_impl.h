// box_tests.h on one instruction set. Include between simd/target_begin.h and simd/target_end.h.
#include "traversal/box_rays.h"
#include "traversal/box_test.h"
#include "traversal/ize_box.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

inline unsigned meets(box_test::Test test, const Ray& ray, float max_coordinate, const box_test::Boxes& boxes) {
  const auto* node = reinterpret_cast<const std::byte*>(boxes.planes);
  const vf<8> tnear(first_distance(ray)), tfar(ray.tfar);
  vf<8> entry;
  if (test == box_test::Test::ize) return IzeLanes<8>(ray).test(node, tnear, tfar, entry);
  if (test == box_test::Test::fast)
    return BoxLanes<8, false>(BoxRay<8, false>(ray, max_coordinate)).test(node, tnear, tfar, entry);
  if (test == box_test::Test::padded)
    return BoxLanes<8, true>(BoxRay<8, true>(ray, max_coordinate)).test(node, tnear, tfar, entry);
  const BoxPad pad{max_coordinate, true};
  BoxRays rays;
  rays.prepare<kNativeWidth, 8>(
      1, [&](int) -> const Ray& { return ray; }, true, pad, [](int) {});
  const auto first_of = [](const float(&of_axis)[3][BoxRays::kMost]) {
    return Vec3f{of_axis[0][0], of_axis[1][0], of_axis[2][0]};
  };
  return BoxLanes<8, true>(BoxRay<8, true>(first_of(rays.r), first_of(rays.near), first_of(rays.far)))
      .test(node, vf<8>(rays.first[0]), vf<8>(ray.tfar * pad.beyond()), entry);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
