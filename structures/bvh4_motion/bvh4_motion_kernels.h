// Rays of a time each through the moving four-wide BVH: planes and vertices are interpolated in registers. The ways of
// traversal are those of the other wide BVHs (structures/bvh/), with a time beside each ray.
//
// Padded boxes: a plane is p + q t with |p|, |p + q| <= M, the box's own (structures/box_pads.h), so |q| <= 2 M;
// computing it is off by u |q t| + u M <= 3 u M (one rounding less where it is fused). Times |r| that is less than what
// box_test.h leaves of its pad: it needs 4 u (M
// + |o|)|r| of 8 u (M + |o|)|r|.
//
// A packet's interval test takes planes where they are farthest out between its rays' first and last time. p + q t, as
// it is computed, grows or falls with t, since rounding keeps order: it lies between its values at the two ends.
#pragma once

#include "structures/bvh/bvh_packet.h"
#include "structures/bvh/bvh_queued.h"
#include "structures/bvh/bvh_single.h"
#include "structures/bvh/bvh_stream.h"
#include "structures/bvh/bvh_stream_lists.h"
#include "structures/bvh/bvh_streams_or_queue.h"
#include "traversal/auto_rows.h"
#include "traversal/kernel_rows.h"
#include "traversal/packet_rows.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// One ray and a node's boxes at its time (structures/bvh/bvh_single.h).
template <bool Padded>
struct MovingNodeTest : SoaNodeTest<4, Padded> {
  static constexpr bool kMoves = true;
  static constexpr std::size_t kBytes = sizeof(bvh4_motion::Node);
  using Base = SoaNodeTest<4, Padded>;
  vf<4> time;

  ARBORETUM_INLINE MovingNodeTest(const Ray& ray, float max_coordinate, float at)
      : Base(ray, max_coordinate), time(within_frames(at)) {}
  ARBORETUM_INLINE MovingNodeTest(const BoxRay<4, Padded>& constants, float first, float last, float at)
      : Base(constants, first, last), time(at) {}
  ARBORETUM_INLINE unsigned test(const std::byte* node, vf<4>& entry) const {
    const auto planes = [&](unsigned offset) {
      return madd(vf<4>::load(node + offsetof(bvh4_motion::Node, motion) + offset), time, vf<4>::load(node + offset));
    };
    return this->box.test_planes(planes, this->tnear, this->tfar, entry);
  }
  static ARBORETUM_INLINE const bvh::NodeReference* children(const std::byte* node) {
    return reinterpret_cast<const bvh4_motion::Node*>(node)->child;
  }
};

/// How packets and streams read a node (structures/bvh/bvh_packet_nodes.h).
struct MovingPacketNodes {
  static constexpr int kBranching = 4, kLanes = 4, kStride = 1;
  static constexpr std::size_t kBytes = sizeof(bvh4_motion::Node);
  static constexpr bool kMoves = true;
  template <bool Padded>
  using Single = MovingNodeTest<Padded>;

  /// At time 0, and from there to time 1.
  static ARBORETUM_INLINE vf<4> planes(const std::byte* node, unsigned k) {
    return vf<4>::load(reinterpret_cast<const bvh4_motion::Node*>(node)->planes[k]);
  }
  static ARBORETUM_INLINE vf<4> motion(const std::byte* node, unsigned k) {
    return vf<4>::load(reinterpret_cast<const bvh4_motion::Node*>(node)->motion[k]);
  }
  /// The farthest out between two times.
  static ARBORETUM_INLINE vf<4> planes(const std::byte* node, unsigned k, float first, float last) {
    const auto* n = reinterpret_cast<const bvh4_motion::Node*>(node);
    const vf<4> p = vf<4>::load(n->planes[k]), q = vf<4>::load(n->motion[k]);
    const vf<4> a = madd(q, vf<4>(first), p), b = madd(q, vf<4>(last), p);
    return (k & 1u) != 0 ? max_x86(a, b) : min_x86(a, b);
  }
  template <class F>
  static ARBORETUM_INLINE F distance(const std::byte* node, unsigned k, int i, F r, F c, F time) {
    const auto* n = reinterpret_cast<const bvh4_motion::Node*>(node);
    return plane_distance(madd(F(n->motion[k][i]), time, F(n->planes[k][i])), r, c);
  }
  static ARBORETUM_INLINE const bvh::NodeReference* children(const std::byte* node) {
    return Single<true>::children(node);
  }
  static unsigned boxes(const std::byte* node) { return Single<true>::boxes(node); }
};

/// The block's triangles at a time: core/motion.h's interpolate(), lane by lane.
template <int M>
ARBORETUM_INLINE VertexBlock<M> posed(const IndexBlock<M>& block, const Vec3f* from, const Vec3f* to, float weight) {
  VertexBlock<M> a = readable(block, from);
  const VertexBlock<M> b = readable(block, to);
  const vf<M> wa(1.0f - weight), wb(weight);
  const auto blend = [&](float(&p)[3][M], const float(&q)[3][M]) {
    for (int axis = 0; axis < 3; ++axis) (vf<M>::load(p[axis]) * wa + vf<M>::load(q[axis]) * wb).store(p[axis]);
  };
  blend(a.v0, b.v0), blend(a.v1, b.v1), blend(a.v2, b.v2);
  return a;
}

/// Leaves (traversal/leaves.h) of indices, whose vertices at the ray's time go to the intersector's tests of vertices.
class MovingLeaves {
  using Block = IndexBlock<4>;

 public:
  struct RayData {
    PreparedRay prepared;
    const Vec3f* from;  ///< the key frames before and behind the ray's time
    const Vec3f* to;
    float weight;
  };
  static constexpr bool kRaysInLanes = false, kBlockByBlock = false;
  static constexpr std::size_t kBytesAhead = sizeof(Block);

  MovingLeaves(const KernelRow& row, const bvh::BvhBase& tree)
      : tests_(find_leaf_tests(VertexBlock<4>::kName, row.intersector, kIsa)),
        mesh_(&static_cast<const bvh4_motion::Bvh4Motion&>(tree).mesh()) {}

  RayData prepare(const Ray& ray, float time) const {
    const FrameTime at = frame_at(time, mesh_->frames());
    RayData data;
    data.from = mesh_->frame(at.frame).data(), data.weight = at.weight;
    data.to = mesh_->moves() ? mesh_->frame(at.frame + 1).data() : data.from;
    tests_->prepare(ray, data.prepared);
    return data;
  }
  bool closest_hit(RayData& data, const std::byte* blocks, unsigned count, float tnear, NearestHit& best) const {
    bool nearer = false;
    any_of(data, blocks, count, [&](const std::byte* now) {
      nearer |= tests_->closest_hit(data.prepared, now, 1, nullptr, tnear, best);
      return false;
    });
    return nearer;
  }
  bool any_hit(RayData& data, const std::byte* blocks, unsigned count, float tnear, float tfar) const {
    return any_of(data, blocks, count,
                  [&](const std::byte* now) { return tests_->any_hit(data.prepared, now, 1, nullptr, tnear, tfar); });
  }
  void finish(RayData& data, NearestHit& best) const {
    if (tests_->finish && best.primitive != NearestHit::kNone) tests_->finish(data.prepared, best);
  }

 private:
  /// Whether test(block of vertices) is true for one of the blocks as they are at the ray's time.
  template <class Test>
  static ARBORETUM_INLINE bool any_of(const RayData& data, const std::byte* blocks, unsigned count, const Test& test) {
    const auto* block = reinterpret_cast<const Block*>(blocks);
    for (const auto* const end = block + count; block != end; ++block) {
      const VertexBlock<4> now = posed(*block, data.from, data.to, data.weight);
      if (test(reinterpret_cast<const std::byte*>(&now))) return true;
    }
    return false;
  }

  const LeafTests* tests_;
  const TriangleMesh* mesh_;
};

/// The ways of traversal with MovingLeaves, whatever leaves they are asked for with.
struct MovingRays {
  template <class, bool Padded, class Counting>
  using Kernel = typename BvhSingle<MovingNodeTest>::template Kernel<MovingLeaves, Padded, Counting>;
  using Single = SingleRayFunctions<Kernel>;

  template <class, bool Padded, bool AnyHit>
  using Queue = QueuedRays<BvhNodeWalk<MovingNodeTest<Padded>, MovingLeaves, AnyHit>>;

  template <class Format, class, bool Padded, bool AnyHit, class Counting>
  using OneStream = Stream<Format, MovingLeaves, Padded, AnyHit, Counting>;
  template <class Format, class, bool Padded, bool AnyHit, class Counting>
  using Lists = StreamLists<Format, MovingLeaves, Padded, AnyHit, Counting>;

  struct PacketFamily : BvhPacketFamily<MovingPacketNodes> {
    template <int W, class, bool AnyHit, class Counting>
    using Packets = BvhPackets<MovingPacketNodes, W, MovingLeaves, AnyHit, Counting>;
  };
};

inline void add_kernels(std::type_identity<bvh4_motion::Bvh4Motion>, KernelRows& rows) {
  using Structure = bvh4_motion::Bvh4Motion;
  using Incoherent =
      IncoherentInStreams<MovingPacketNodes, MovingRays::Queue, MovingRays::Single, MovingRays::OneStream>;
  add_rows<Structure, MovingRays::Single>(rows, "single", TypeList<>{});
  add_queued_rows<Structure, MovingRays::Queue, MovingRays::Single>(rows, TypeList<>{});
  add_packet_rows<Structure, MovingRays::PacketFamily>(rows, TypeList<>{});
  add_rows<Structure,
           AutoFunctions<MovingRays::PacketFamily, TypeList<>, kBesideStreams, Incoherent, MovingRays::Single>>(
      rows, "auto", TypeList<>{});
  add_stream_rows<Structure, MovingPacketNodes, TypeList<>, TypeList<>, MovingRays::OneStream, MovingRays::Lists>(rows);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
