// Rays against the quantised boxes of a node: planes are decoded to floats, one `and`, one conversion and one operation
// each, and then met as those of bvh::SoaNodes (traversal/box_test.h), whose promises these are: a decoded plane is
// rounded, which keeps it conservative (bvh_quantised.h), and so is a box's like any other. It reaches to 1.004 M at
// most, M the node's, which pads have room for: they are twice what the roundings of planes within M need. Where pads
// are for the less that a box itself has (structures/box_pads.h) a plane at p beyond that lies |p| less that beyond the
// box, and its roundings are a few 2^-24 |p|. q * step is exact, or infinite for an upper plane, so it makes no
// difference whether the sum is fused.
#pragma once

#include "traversal/usual_leaves.h"
#include "structures/bvh/bvh_queued.h"
#include "structures/bvh/bvh_packet.h"
#include "structures/bvh/bvh_single.h"
#include "structures/bvh/bvh_stream.h"
#include "structures/bvh/bvh_stream_lists.h"
#include "structures/bvh/bvh_streams_or_queue.h"
#include "traversal/auto_rows.h"
#include "traversal/kernel_rows.h"
#include "traversal/packet_rows.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Decoded planes: those of `side` of all children along an axis. Slots without a child have some.
template <int N>
class DecodedPlanes {
  using Node = bvh_quantised::Node<N>;
  using F = vf<N>;

 public:
  ARBORETUM_INLINE explicit DecodedPlanes(const std::byte* node) : node_(reinterpret_cast<const Node*>(node)) {}

  template <unsigned Axis>
  ARBORETUM_INLINE F of(unsigned side) const {
    const vi<N> q = vi<N>::load(node_->planes[side]) & vi<N>(std::int32_t(bvh_quantised::plane_mask(Axis)));
    return madd(to_float(q), F(step(Axis)), F(node_->origin[Axis]));
  }

 private:
  ARBORETUM_INLINE float step(unsigned axis) const {
    if constexpr (requires { node_->step; }) {
      return node_->step[axis];
    } else {
      return __builtin_bit_cast(float, std::uint32_t(node_->exponent[axis]) << 23);
    }
  }
  const Node* node_;
};

template <int N, bool Padded>
struct QuantisedNodeTest {
  static constexpr int W = N, kSlots = N, kStride = 1;
  static constexpr std::size_t kBytes = sizeof(bvh_quantised::Node<N>);
  using F = vf<W>;
  using Node = bvh_quantised::Node<N>;
  BoxLanes<N, Padded> box;
  F tnear, tfar;
  unsigned octant;

  ARBORETUM_INLINE QuantisedNodeTest(const Ray& ray, float max_coordinate)
      : QuantisedNodeTest(BoxRay<N, Padded>(ray, max_coordinate), first_distance(ray), ray.tfar) {}
  ARBORETUM_INLINE QuantisedNodeTest(const BoxRay<N, Padded>& constants, float first, float last)
      : box(constants), tnear(first), tfar(last), octant(constants.octant) {}

  ARBORETUM_INLINE unsigned test(const std::byte* node, F& entry) const {
    const DecodedPlanes<N> p(node);
    const unsigned x = octant & 1u, y = octant >> 1 & 1u, z = octant >> 2;
    const vm<W> meets =
        box.meets({p.template of<0>(x), p.template of<1>(y), p.template of<2>(z)},
                  {p.template of<0>(x ^ 1u), p.template of<1>(y ^ 1u), p.template of<2>(z ^ 1u)}, tnear, tfar, entry);
    return meets.bits() & reinterpret_cast<const Node*>(node)->children;
  }
  ARBORETUM_INLINE void shorten(float t) { tfar = F(t); }
  static ARBORETUM_INLINE const bvh::NodeReference* children(const std::byte* node) {
    return reinterpret_cast<const Node*>(node)->child;
  }
  static unsigned boxes(const std::byte* node) {
    return unsigned(__builtin_popcount(reinterpret_cast<const Node*>(node)->children));
  }
};

template <int N>
struct QuantisedTests {
  template <bool Padded>
  using Nodes = QuantisedNodeTest<N, Padded>;
  template <bool Padded>
  using Constants = NodeConstants<QuantisedNodeTest<N, Padded>, N, Padded>;
};

/// How packets and streams read a node (structures/bvh/bvh_packet_nodes.h): plane k = 2 * axis + side. Their rays meet
/// planes that are decoded once for all of them.
template <int N>
struct QuantisedPacketNodes {
  static constexpr int kBranching = N, kLanes = N, kStride = 1;
  using Node = bvh_quantised::Node<N>;
  using Decoded = SoaPacketNodes<N>;
  static constexpr std::size_t kBytes = sizeof(Node);
  template <bool Padded>
  using Single = QuantisedNodeTest<N, Padded>;

  static ARBORETUM_INLINE vf<N> planes(const std::byte* node, unsigned k) {
    const DecodedPlanes<N> decoded(node);
    const unsigned side = k & 1u;
    const vf<N> p = k < 2   ? decoded.template of<0>(side)
                    : k < 4 ? decoded.template of<1>(side)
                            : decoded.template of<2>(side);
    const vf<N> nowhere(side ? -std::numeric_limits<float>::infinity() : std::numeric_limits<float>::infinity());
    return select(vm<N>::from_bits(reinterpret_cast<const Node*>(node)->children), p, nowhere);
  }
  static ARBORETUM_INLINE const bvh::NodeReference* children(const std::byte* node) {
    return Single<true>::children(node);
  }
  static unsigned boxes(const std::byte* node) { return Single<true>::boxes(node); }
};

template <int N>
void add_kernels(std::type_identity<bvh::WideBvh<bvh_quantised::QuantisedNodes<N>>>, KernelRows& rows) {
  using Structure = bvh::WideBvh<bvh_quantised::QuantisedNodes<N>>;
  using Packets = BvhPacketFamily<QuantisedPacketNodes<N>>;
  using Queue = BvhNodeQueue<QuantisedTests<N>::template Constants>;
  using Single = typename BvhSingle<QuantisedTests<N>::template Nodes>::Functions;
  add_rows<Structure, Single>(rows, "single", UsualLeaves{});
  add_queued_rows<Structure, Queue::template Of, Single>(rows, BatchLeaves{});
  add_packet_rows<Structure, Packets>(rows, TypeList<>{});
  using Incoherent = IncoherentInStreams<QuantisedPacketNodes<N>, Queue::template Of, Single>;
  add_rows<Structure, AutoFunctions<Packets, BatchLeaves, kBesideStreams, Incoherent, Single>>(rows, "auto",
                                                                                               BatchLeaves{});
  add_stream_rows<Structure, QuantisedPacketNodes<N>>(rows);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
