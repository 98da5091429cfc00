// Single rays through a wide BVH with Ize's box test (traversal/ize_box.h). It is there to be compared with the others
// in node visits and answers; leaves are always called (traversal/leaves.h), so times compare with those of a leaf that
// the other box tests call too: `triangle4i`.
#pragma once

#include "structures/bvh/bvh_single.h"
#include "traversal/ize_box.h"
#include "traversal/kernel_rows.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Nodes of bvh::SoaNodes<N>.
template <int N>
struct IzeNodeTest {
  static constexpr int W = lanes_for(N), kSlots = W, kStride = 1;
  using F = vf<W>;
  IzeLanes<N> box;
  F tnear, tfar;

  ARBORETUM_INLINE IzeNodeTest(const Ray& ray, float /*max_coordinate*/)
      : box(ray), tnear(first_distance(ray)), tfar(ray.tfar) {}
  ARBORETUM_INLINE unsigned test(const std::byte* node, F& entry) const { return box.test(node, tnear, tfar, entry); }
  ARBORETUM_INLINE void shorten(float t) { tfar = F(t); }
  static ARBORETUM_INLINE const bvh::NodeReference* children(const std::byte* node) {
    return SoaNodeTest<N, false>::children(node);
  }
  static unsigned boxes(const std::byte* node) { return SoaNodeTest<N, false>::boxes(node); }
};

template <int N>
struct IzeTests {
  template <bool>
  using Nodes = IzeNodeTest<N>;
};

/// Adds the rows of `single` with the box test `ize`.
template <int N>
void add_ize_rows(KernelRows& rows) {
  using Functions = typename BvhSingle<IzeTests<N>::template Nodes>::Functions;
  for_each_test<bvh::Bvh<N>>([&](const LeafTests& tests) {
    rows.push_back({bvh::Bvh<N>::static_info().name, tests.leaf, tests.intersector, "ize", "single", kIsa, &tests,
                    Functions::template timed<CalledLeaves, false>(), Functions::template counting<false>()});
  });
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
