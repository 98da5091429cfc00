// One ray against the four boxes of a bvh4_aos node: 16 lanes as 4 x 4, one register with AVX-512, two with AVX2, four
// with SSE.
//
// Lanes x y z of a group hold one box's planes, lane w the ray's own interval: with r.w = 1 and the planes' w = 0 the
// same operation that gives the distances leaves tnear (near) or tfar (far) there, so that the reduction over a group
// yields the clipped interval. Near planes are chosen by the direction's signs, as in box_test.h, whose constants and
// promises these are.
#pragma once

#include "simd/swizzle.h"
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

template <bool Padded>
struct AosNodeTest {
  /// AVX-512 leaves a child's result in lane 0 of its group, the others gather the four.
  static constexpr bool kInGroups = kRegisterWidth == 16;
  static constexpr int W = kInGroups ? 16 : 4, kSlots = 4, kStride = kInGroups ? 1 : 4;
  static constexpr std::size_t kBytes = sizeof(bvh4_aos::Node);
  using Lanes = vf<16>;
  Lanes r, f, g;
  vm<16> upper_is_near, upper_is_far;  ///< in lane w both: there the maximum's is a number, the minimum's a reference

  ARBORETUM_INLINE AosNodeTest(const Ray& ray, float max_coordinate)
      : AosNodeTest(BoxRay<4, Padded>(ray, max_coordinate), first_distance(ray), ray.tfar) {}
  ARBORETUM_INLINE AosNodeTest(const BoxRay<4, Padded>& b, float first, float last)
      : r(repeat_four<16>(four(b.r.x, b.r.y, b.r.z, 1.0f))),
        f(repeat_four<16>(four(b.near_offset.x, b.near_offset.y, b.near_offset.z, -first))),
        g(repeat_four<16>(four(b.far_offset.x, b.far_offset.y, b.far_offset.z, -last))),
        upper_is_near(vm<16>::from_bits((b.octant | 8u) * 0x1111u)),
        upper_is_far(vm<16>::from_bits((~b.octant & 15u) * 0x1111u)) {}

  ARBORETUM_INLINE unsigned test(const std::byte* node, vf<W>& entry) const {
    const Lanes lower = Lanes::load(node), upper = Lanes::load(node + 64);
    const Lanes near = select(upper_is_near, upper, lower), far = select(upper_is_far, upper, lower);
    Lanes enter, leave;
    if constexpr (kHasFma) {
      enter = msub(near, r, f), leave = msub(far, r, g);
    } else {
      enter = (near - f) * r, leave = (far - g) * r;
    }
    // x with z and y with w, then both: a NaN may take a neighbour's bound with it, but never lane w's.
    const auto larger = []<int V>(vf<V> a, vf<V> b) { return max_x86(a, b); };
    const auto smaller = []<int V>(vf<V> a, vf<V> b) { return min_x86(a, b); };
    if constexpr (kInGroups) {
      enter = larger(enter, permute_in_fours<2, 3, 0, 1>(enter)),
      leave = smaller(leave, permute_in_fours<2, 3, 0, 1>(leave));
      entry = larger(enter, permute_in_fours<1, 0, 3, 2>(enter));
      return (entry <= smaller(leave, permute_in_fours<1, 0, 3, 2>(leave))).bits() & 0x1111u;
    } else {
      entry = reduce_fours(enter, larger);
      return (entry <= reduce_fours(leave, smaller)).bits();
    }
  }
  ARBORETUM_INLINE void shorten(float t) { g = select(vm<16>::from_bits(0x8888u), Lanes(-t), g); }
  static ARBORETUM_INLINE const bvh::NodeReference* children(const std::byte* node) {
    return reinterpret_cast<const bvh::NodeReference*>(node) + 3;
  }
  static unsigned boxes(const std::byte* node) {
    const auto* n = reinterpret_cast<const bvh4_aos::Node*>(node);
    unsigned count = 0;
    for (int i = 0; i < 4; ++i) count += n->lower[i].x <= n->upper[i].x;
    return count;
  }
};

/// How packets and streams read a node (structures/bvh/bvh_packet_nodes.h).
struct AosPacketNodes {
  static constexpr int kBranching = 4, kLanes = 4, kStride = 4;
  static constexpr std::size_t kBytes = sizeof(bvh4_aos::Node);
  template <bool Padded>
  using Single = AosNodeTest<Padded>;

  static ARBORETUM_INLINE float plane(const std::byte* node, unsigned k, int i) {
    float p;
    std::memcpy(&p, node + ((k & 1u) * 16u + unsigned(i) * 4u + k / 2u) * sizeof(float), sizeof p);
    return p;
  }
  template <class F>
  static ARBORETUM_INLINE F distance(const std::byte* node, unsigned k, int i, F r, F c) {
    return plane_distance(F(plane(node, k, i)), r, c);
  }
  static ARBORETUM_INLINE vf<4> planes(const std::byte* node, unsigned k) {
    return four(plane(node, k, 0), plane(node, k, 1), plane(node, k, 2), plane(node, k, 3));
  }
  static ARBORETUM_INLINE const bvh::NodeReference* children(const std::byte* node) {
    return Single<true>::children(node);
  }
  static unsigned boxes(const std::byte* node) { return Single<true>::boxes(node); }
};

inline void add_kernels(std::type_identity<bvh4_aos::Bvh4Aos>, KernelRows& rows) {
  using Structure = bvh4_aos::Bvh4Aos;
  using Packets = BvhPacketFamily<AosPacketNodes>;
  using Single = BvhSingle<AosNodeTest>::Functions;
  using AosLeaves =
      std::conditional_t<kRegisterWidth == 1, TypeList<>, TypeList<CompiledLeaves<AosBlock, MollerTrumbore>>>;
  add_rows<Structure, Single>(rows, "single", ConcatLists<UsualLeaves, AosLeaves>{});
  add_queued_rows<Structure, BvhNodeQueue<AosNodeTest>::Of, Single>(rows, BatchLeaves{});
  add_packet_rows<Structure, Packets>(rows, TypeList<>{});
  using Incoherent = IncoherentInStreams<AosPacketNodes, BvhNodeQueue<AosNodeTest>::Of, Single>;
  add_rows<Structure, AutoFunctions<Packets, TypeList<>, kBesideStreams, Incoherent, Single>>(rows, "auto",
                                                                                              BatchLeaves{});
  add_stream_rows<Structure, AosPacketNodes>(rows);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
