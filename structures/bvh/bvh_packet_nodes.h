// How packets read nodes, and how one of their rays goes on alone.
#pragma once

#include "structures/bvh/bvh_single.h"
#include "traversal/box_rays.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// How packets read the nodes of bvh::SoaNodes<N>: planes k = 2 * axis + side, side 0 lower and 1 upper, of all
/// children; where rays meet that of child i, as their own box test computes it.
template <int N>
struct SoaPacketNodes {
  static constexpr int kBranching = N, kLanes = lanes_for(N);
  template <bool Padded>
  using Single = SoaNodeTest<N, Padded>;

  static ARBORETUM_INLINE vf<kLanes> planes(const std::byte* node, unsigned k) {
    return vf<kLanes>::load(node + k * (N * sizeof(float)));
  }
  template <class F>
  static ARBORETUM_INLINE F distance(const std::byte* node, unsigned k, int i, F r, F c) {
    float p;
    std::memcpy(&p, node + (k * N + unsigned(i)) * sizeof(float), sizeof p);
    return plane_distance(F(p), r, c);
  }
  static ARBORETUM_INLINE bvh::NodeReference child(const std::byte* node, int i) {
    return Single<true>::children(node)[i];
  }
  static unsigned boxes(const std::byte* node) { return Single<true>::boxes(node); }
};

/// One ray through what hangs below `root`, with what it has met already; `box`, `first` and, where boxes move, `time`
/// are of the packet's arrays.
template <class Format, class Leaves, bool Padded, bool AnyHit, class Counting, class... Time>
__attribute__((noinline)) bool trace_below(const std::byte* base, bvh::NodeReference root,
                                           const BoxRay<Format::kBranching, Padded>& box, float first, const Ray& ray,
                                           const Leaves& leaves, typename Leaves::RayData& data, NearestHit& best,
                                           StackEntry* stack, const LeafForm& form, const Counting& counting,
                                           typename Counting::Depth depth, Time... time) {
  typename Format::template Single<Padded> nodes(box, first, best.t, time...);
  return search_bvh<AnyHit>(base, root, nodes, stack, ray, leaves, data, best, form, counting, depth);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
