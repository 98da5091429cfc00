// How packets and streams read nodes, and how one of a packet's rays goes on alone.
#pragma once

#include "structures/bvh/bvh_single.h"
#include "traversal/box_rays.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// How packets and streams read the nodes of bvh::SoaNodes<N>: planes k = 2 * axis + side, side 0 lower and 1 upper, of
/// all children; where rays meet that of child i, as their own box test computes it; references, child i's at
/// children()[i * kStride].
template <int N>
struct SoaPacketNodes {
  static constexpr int kBranching = N, kLanes = lanes_for(N), kStride = 1;
  static constexpr std::size_t kBytes = sizeof(bvh::Node<N>);
  template <bool Padded>
  using Single = SoaNodeTest<N, Padded>;

  static ARBORETUM_INLINE vf<kLanes> planes(const std::byte* node, unsigned k) {
    return load_first<N>(node + k * (N * sizeof(float)));
  }
  template <class F>
  static ARBORETUM_INLINE F distance(const std::byte* node, unsigned k, int i, F r, F c) {
    float p;
    std::memcpy(&p, node + (k * N + unsigned(i)) * sizeof(float), sizeof p);
    return plane_distance(F(p), r, c);
  }
  static ARBORETUM_INLINE const bvh::NodeReference* children(const std::byte* node) {
    return Single<true>::children(node);
  }
  static unsigned boxes(const std::byte* node) { return Single<true>::boxes(node); }
};

/// The planes of all children of a node in registers, for a stream's rays, which are of one octant.
template <class Format>
class NodePlanes {
  using F = vf<Format::kLanes>;
  using Planes = vf3<Format::kLanes>;

 public:
  ARBORETUM_INLINE NodePlanes(const std::byte* node, unsigned octant) {
    const unsigned x = octant & 1u, y = 2 + (octant >> 1 & 1u), z = 4 + (octant >> 2);
    near_ = {Format::planes(node, x), Format::planes(node, y), Format::planes(node, z)};
    far_ = {Format::planes(node, x ^ 1u), Format::planes(node, y ^ 1u), Format::planes(node, z ^ 1u)};
    if constexpr (kMoves) {
      near_moves_ = {Format::motion(node, x), Format::motion(node, y), Format::motion(node, z)};
      far_moves_ = {Format::motion(node, x ^ 1u), Format::motion(node, y ^ 1u), Format::motion(node, z ^ 1u)};
    }
  }
  /// Which children a ray meets, as BoxLanes::meets(), at that time where boxes move.
  template <class Lanes>
  ARBORETUM_INLINE auto met(const Lanes& ray, [[maybe_unused]] float time, F tnear, F tfar, F& entry) const {
    if constexpr (kMoves) {
      return ray.meets(at(near_, near_moves_, F(time)), at(far_, far_moves_, F(time)), tnear, tfar, entry);
    } else {
      return ray.meets(near_, far_, tnear, tfar, entry);
    }
  }
  /// Where the children's centres lie along a direction (at time 0), times two.
  [[nodiscard]] ARBORETUM_INLINE F centres(Vec3f direction) const {
    return (near_.x + far_.x) * F(direction.x) + (near_.y + far_.y) * F(direction.y) +
           (near_.z + far_.z) * F(direction.z);
  }

 private:
  static constexpr bool kMoves = kBoxesMove<Format>;
  struct Nothing {};
  static ARBORETUM_INLINE Planes at(const Planes& from, const Planes& motion, F time) {
    return {madd(motion.x, time, from.x), madd(motion.y, time, from.y), madd(motion.z, time, from.z)};
  }

  Planes near_, far_;
  [[no_unique_address]] std::conditional_t<kMoves, Planes, Nothing> near_moves_, far_moves_;
};

/// What a packet reads of a node's planes: the node itself, or, for formats whose planes are decoded once for all rays
/// (`Format::Decoded` says how those are read), these.
template <class Format>
struct PacketNode {
  using Planes = Format;
  const std::byte* planes;
  ARBORETUM_INLINE explicit PacketNode(const std::byte* node) : planes(node) {}
};
template <class Format>
requires requires { typename Format::Decoded; }
struct PacketNode<Format> {
  using Planes = typename Format::Decoded;
  alignas(64) std::byte planes[6 * Format::kBranching * sizeof(float)];
  ARBORETUM_INLINE explicit PacketNode(const std::byte* node) {
    for (unsigned k = 0; k < 6; ++k) Format::planes(node, k).store(planes + k * Format::kBranching * sizeof(float));
  }
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
