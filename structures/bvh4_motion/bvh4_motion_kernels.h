// One ray of a time through the moving four-wide BVH: planes and vertices are interpolated in registers.
//
// Padded boxes: a plane is p + q t with |p|, |p + q| <= M, so |q| <= 2 M; computing it is off by u |q t| + u M <= 3 u M (one rounding
// less where it is fused). Times |r| that is less than what box_test.h leaves of its pad: it needs 4 u (M + |o|)|r| of 8 u (M + |o|)|r|.
#pragma once

#include "intersectors/moller_trumbore.h"
#include "intersectors/pluecker.h"
#include "intersectors/watertight.h"
#include "structures/bvh/walk_single.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <bool Padded>
struct MovingBoxes {
  BoxLanes<4, Padded> lanes;
  vf<4> time;

  ARBORETUM_INLINE unsigned test(const std::byte* node, vf<4> tnear, vf<4> tfar, vf<4>& entry) const {
    const auto planes = [&](unsigned offset) {
      return madd(vf<4>::load(node + offsetof(bvh4_motion::Node, motion) + offset), time, vf<4>::load(node + offset));
    };
    return lanes.test_planes(planes, tnear, tfar, entry);
  }
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

template <class Intersector, bool Padded, class Counting>
class MotionTracer {
 public:
  MotionTracer(const Accel& accel, Counters* counters)
      : accel_(static_cast<const bvh4_motion::Bvh4Motion&>(accel)), counting_(counters), stack_(accel_.stack_entries()) {}

  template <bool AnyHit>
  bool trace(const Ray& ray, float time, NearestHit& best) {
    const TriangleMesh& mesh = accel_.mesh();
    const FrameTime at = frame_at(time, mesh.frames());
    const Vec3f* from = mesh.frame(at.frame).data();
    const Vec3f* to = mesh.moves() ? mesh.frame(at.frame + 1).data() : from;
    const float within = time > 0.0f ? (time < 1.0f ? time : 1.0f) : 0.0f;
    const MovingBoxes<Padded> boxes{BoxLanes<4, Padded>(BoxRay<4, Padded>(ray, accel_.max_coordinate())), vf<4>(within)};
    const typename Intersector::RayData data(ray);
    const auto leaf = [&](bvh::NodeReference reference) {
      const auto* block = reinterpret_cast<const IndexBlock<4>*>(accel_.base() + bvh::offset_of(reference));
      const auto* const end = block + bvh::block_count(reference);
      count_leaf(block, end);
      for (; block != end; ++block) {
        if constexpr (AnyHit) {
          if (any_hit_block<Intersector>(data, posed(*block, from, to, at.weight), ray.tnear, ray.tfar)) return true;
        } else {
          closest_hit_block<Intersector>(data, posed(*block, from, to, at.weight), ray.tnear, best);
        }
      }
      return false;
    };
    const auto node = [&](const std::byte* n, unsigned hit) { count_node(n, hit); };
    return walk_bvh<4, offsetof(bvh4_motion::Node, child)>(accel_.base(), accel_.root(), boxes, ray.tnear, best.t, stack_.data(), leaf, node);
  }

 private:
  void count_node(const std::byte* node, unsigned hit) {
    if constexpr (Counting::kCounting) {
      const auto* lower = reinterpret_cast<const float*>(node);
      for (int i = 0; i < 4; ++i) {
        const bool child = lower[i] <= lower[4 + i];
        counting_.counters.boxes += child, counting_.counters.lanes_active += child;
      }
      ++counting_.counters.nodes;
      counting_.counters.boxes_hit += unsigned(__builtin_popcount(hit));
      counting_.counters.lanes += 4;
    }
  }
  void count_leaf(const IndexBlock<4>* block, const IndexBlock<4>* end) {
    if constexpr (Counting::kCounting) {
      ++counting_.counters.leaves;
      for (; block != end; ++block) {
        ++counting_.counters.blocks;
        counting_.counters.lanes += 4;
        counting_.counters.triangles += unsigned(triangles_in(*block)), counting_.counters.lanes_active += unsigned(triangles_in(*block));
      }
    }
  }

  const bvh4_motion::Bvh4Motion& accel_;
  Counting counting_;
  TraversalStack stack_;
};

template <class Block, class Intersector, bool Padded>
struct MotionMaker {
  template <class Counting>
  static void closest(const Accel& a, RayBatch rays, std::span<Hit> hits, Counters* counters) {
    MotionTracer<Intersector, Padded, Counting> tracer(a, counters);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      NearestHit best{rays[i].tfar};
      if (is_valid_in_lanes(rays[i])) tracer.template trace<false>(rays[i], rays.time(i), best);
      hits[i] = to_hit(best);
    }
    if constexpr (Counting::kCounting) counters->rays += rays.size();
  }
  template <class Counting>
  static void any(const Accel& a, RayBatch rays, std::span<std::uint8_t> occluded, Counters* counters) {
    MotionTracer<Intersector, Padded, Counting> tracer(a, counters);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      NearestHit best{rays[i].tfar};
      occluded[i] = is_valid_in_lanes(rays[i]) && tracer.template trace<true>(rays[i], rays.time(i), best);
    }
    if constexpr (Counting::kCounting) counters->rays += rays.size();
  }
  static void closest_hit(const Accel& a, RayBatch r, std::span<Hit> h, Counters* c) { closest<NoCounters>(a, r, h, c); }
  static void any_hit(const Accel& a, RayBatch r, std::span<std::uint8_t> h, Counters* c) { any<NoCounters>(a, r, h, c); }
  static void count_closest_hit(const Accel& a, RayBatch r, std::span<Hit> h, Counters* c) { closest<WithCounters>(a, r, h, c); }
  static void count_any_hit(const Accel& a, RayBatch r, std::span<std::uint8_t> h, Counters* c) { any<WithCounters>(a, r, h, c); }
};

inline void add_kernels(std::type_identity<bvh4_motion::Bvh4Motion>, KernelRows& rows) {
  add_rows<MotionMaker>(rows, bvh4_motion::Bvh4Motion::kName, "single", kIsa, TypeList<IndexBlock<4>>{},
                        TypeList<MollerTrumbore, Pluecker, Watertight>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
