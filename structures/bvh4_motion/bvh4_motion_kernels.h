// One ray of a time through the moving four-wide BVH: planes and vertices are interpolated in registers.
//
// Padded boxes: a plane is p + q t with |p|, |p + q| <= M, so |q| <= 2 M; computing it is off by u |q t| + u M <= 3 u M
// (one rounding less where it is fused). Times |r| that is less than what box_test.h leaves of its pad: it needs 4 u (M
// + |o|)|r| of 8 u (M + |o|)|r|.
#pragma once

#include "structures/bvh/bvh_single.h"
#include "traversal/kernel_rows.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// One ray and a node's boxes at its time (structures/bvh/bvh_single.h).
template <bool Padded>
struct MovingNodeTest : SoaNodeTest<4, Padded> {
  vf<4> time;

  ARBORETUM_INLINE MovingNodeTest(const Ray& ray, float max_coordinate, float at)
      : SoaNodeTest<4, Padded>(ray, max_coordinate), time(at) {}
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

/// Leaves hold indices; their vertices at the ray's time go to the intersector's tests of vertices.
template <class Leaves, bool Padded, class Counting>
class MotionKernel {
 public:
  MotionKernel(const Accel& accel, const KernelRow& row, Counting counting)
      : accel_(static_cast<const bvh4_motion::Bvh4Motion&>(accel)),
        tests_(*find_leaf_tests(VertexBlock<4>::kName, row.intersector, kIsa)), form_(*row.tests->form),
        counting_(counting), stack_(accel_.stack_entries()) {}

  template <bool AnyHit>
  bool trace(const Ray& ray, float time, NearestHit& best) {
    const TriangleMesh& mesh = accel_.mesh();
    const FrameTime at = frame_at(time, mesh.frames());
    const Vec3f* from = mesh.frame(at.frame).data();
    const Vec3f* to = mesh.moves() ? mesh.frame(at.frame + 1).data() : from;
    MovingNodeTest<Padded> nodes(ray, accel_.max_coordinate(), time > 0.0f ? (time < 1.0f ? time : 1.0f) : 0.0f);
    PreparedRay data;
    tests_.prepare(ray, data);
    const std::byte* const base = accel_.base();
    const bool hit = walk_bvh<AnyHit>(base, accel_.root(), nodes, stack_.data(), best.t, counting_,
                                      [&](bvh::NodeReference reference) {
                                        const std::byte* const blocks = base + bvh::offset_of(reference);
                                        const unsigned count = bvh::block_count(reference);
                                        counting_.leaf(form_, blocks, AnyHit ? 0 : count);
                                        const auto* block = reinterpret_cast<const IndexBlock<4>*>(blocks);
                                        for (const auto* const end = block + count; block != end; ++block) {
                                          const VertexBlock<4> now = posed(*block, from, to, at.weight);
                                          const auto* bytes = reinterpret_cast<const std::byte*>(&now);
                                          if constexpr (AnyHit) {
                                            counting_.blocks(form_, reinterpret_cast<const std::byte*>(block), 1);
                                            if (tests_.any_hit(data, bytes, 1, nullptr, ray.tnear, ray.tfar))
                                              return true;
                                          } else {
                                            tests_.closest_hit(data, bytes, 1, nullptr, ray.tnear, best);
                                          }
                                        }
                                        if constexpr (!AnyHit) nodes.shorten(best.t);
                                        return false;
                                      });
    if (!AnyHit && tests_.finish && best.primitive != NearestHit::kNone) tests_.finish(data, best);
    return hit;
  }

 private:
  const bvh4_motion::Bvh4Motion& accel_;
  const LeafTests& tests_;
  const LeafForm& form_;
  Counting counting_;
  TraversalStack stack_;
};

inline void add_kernels(std::type_identity<bvh4_motion::Bvh4Motion>, KernelRows& rows) {
  add_rows<bvh4_motion::Bvh4Motion, SingleRayFunctions<MotionKernel>>(rows, "single", TypeList<>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
