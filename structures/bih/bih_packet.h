// Packets: up to 64 rays go through a bounding interval hierarchy together, each with an interval of t of its own in a
// lane and a bit in the mask of those that are in a node.
//
// Rays that share an octant share near and far, and so one traversal; a packet of mixed signs is one masked traversal
// an octant. A far child (any hit: a near child) waits on the stack with its rays and their intervals; where no more
// than `threshold` rays are left they go on alone.
//
// A ray's tests are those of bih_single.h, operation by operation, and its nodes come in the same order: it visits just
// the nodes that it would visit alone, and its answer is the same bit for bit, with `fast` planes, too.
#pragma once

#include "structures/bih/bih_single.h"
#include "structures/leaves/leaf_lists_packet.h"
#include "traversal/box_rays.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// W rays a register. `fast` and `padded` are one class with other constants.
template <int W, class Leaves, bool AnyHit, class Counting>
class BihPackets : private ListedPacketLeaves<W, Leaves, AnyHit, Counting, BoxRays> {
  using Base = ListedPacketLeaves<W, Leaves, AnyHit, Counting, BoxRays>;

 public:
  using Base::best, Base::set_width, Base::times_alone;

  BihPackets(const bih::Bih& tree, const KernelRow& row, Counting counting)
      : Base(row, tree.leaves(), counting), tree_(tree), padded_(row.box == "padded"), stack_(tree.stack_entries() + 1),
        single_stack_(tree) {}

  /// Traces `rays`, 1 to kMost; their hits are then in best().
  void trace(const RayBatch& rays, int threshold) {
    Base::trace(
        rays, threshold,
        [&](int count, const auto& ray_at, const auto& each) {
          lanes_.template prepare<W, 2>(count, ray_at, padded_, BoxPad{tree_.max_coordinate()}, each);
        },
        [&](Mask mask, unsigned octant) { traverse(mask, octant); });
  }

 private:
  using typename Base::Mask;
  using F = vf<W>;
  using Base::active_, Base::best_, Base::chunks_, Base::counting_, Base::kMost, Base::lanes_, Base::rays_;

  /// A node that waits, or the one at hand: its rays and their intervals.
  struct alignas(64) Entry {
    float low[kMost], high[kMost];
    const bih::Node* node;
    Mask mask;
  };

  ARBORETUM_INLINE F at_begin(float plane, unsigned axis, int k) const {
    return plane_distance(F(plane), F::load(lanes_.r[axis] + k), F::load(lanes_.near[axis] + k));
  }
  ARBORETUM_INLINE F at_end(float plane, unsigned axis, int k) const {
    return plane_distance(F(plane), F::load(lanes_.r[axis] + k), F::load(lanes_.far[axis] + k));
  }

  /// Calls each(k, lanes) for the registers that hold rays of `mask`; returns the rays for which it is true.
  template <class Each>
  ARBORETUM_INLINE Mask in_lanes(Mask mask, const Each& each) const {
    Mask result = 0;
    for (int c = 0; c < chunks_; ++c)
      if (const unsigned in = Base::lanes_of(mask, c); in != 0) result |= Mask(each(c * W).bits() & in) << (c * W);
    return result;
  }

  void traverse(Mask group, unsigned octant) {
    Entry* const stack = stack_.data();
    Entry* top = stack;  // the node at hand; those below wait
    top->node = tree_.nodes(), top->mask = in_lanes(group, [&](int k) {
                                 F low = F::load(lanes_.rays.tnear + k), high = F::load(lanes_.t + k);
                                 for (unsigned a = 0; a < 3; ++a) {
                                   const float faces[2] = {(&tree_.bounds().lower.x)[a], (&tree_.bounds().upper.x)[a]};
                                   const unsigned back = octant >> a & 1u;
                                   low = max_x86(at_begin(faces[back], a, k), low),
                                   high = min_x86(at_end(faces[1 - back], a, k), high);
                                 }
                                 low.store(top->low + k), high.store(top->high + k);
                                 return low <= high;
                               });
    while (true) {
      const bih::Node* const node = top->node;
      const std::uint32_t kind = node->kind();
      if (top->mask != 0 && kind == bih::Node::kLeaf) {
        Base::leaf(node->code(), top->mask);
      } else if (top->mask != 0 && Base::few(top->mask)) {
        Base::go_on_alone(top->mask, [&](int i, auto& visits) {
          const auto of = [i](const auto& axes) { return Vec3f{axes[0][i], axes[1][i], axes[2][i]}; };
          return search_bih<AnyHit>(tree_, IntervalRay(of(lanes_.r), of(lanes_.near), of(lanes_.far)), node,
                                    top->low[i], top->high[i], best_[i], counting_, single_stack_.data(), visits);
        });
      } else if (top->mask != 0) {
        top = kind < bih::Node::kLeaf ? divide(top, kind, octant >> kind & 1u)
                                      : clip(top, kind - bih::Node::kClip, octant >> (kind - bih::Node::kClip) & 1u);
        continue;
      }
      if (top == stack) return;
      --top;
      if constexpr (AnyHit) {
        top->mask &= active_;
      } else {
        top->mask = in_lanes(top->mask, [&](int k) {
          const F t = F::load(lanes_.t + k);
          min_x86(t, F::load(top->high + k)).store(top->high + k);
          return ~(F::load(top->low + k) > t);
        });
      }
    }
  }

  /// A node of two children, with the planes that end the lower and begin the upper one. Returns the child to go on
  /// with; another waits below it.
  ARBORETUM_INLINE Entry* divide(Entry* top, unsigned axis, unsigned back) const {
    const bih::Node* const node = top->node;
    Entry* const next = top + 1;
    Entry* const near = AnyHit ? top : next;
    Entry* const far = AnyHit ? next : top;
    const Mask mask = top->mask;
    Mask in_far = 0;
    const Mask in_near = in_lanes(mask, [&](int k) {
      const F low = F::load(top->low + k), high = F::load(top->high + k);
      const F near_high = min_x86(at_end(node->clip[back], axis, k), high),
              far_low = max_x86(at_begin(node->clip[1 - back], axis, k), low);
      (AnyHit ? high : low).store((AnyHit ? next->high : next->low) + k);  // what `top` has of it stays
      near_high.store(near->high + k), far_low.store(far->low + k);
      in_far |= Mask((far_low <= high).bits()) << k;
      return low <= near_high;
    });
    in_far &= mask;
    const bih::Node* const children = tree_.nodes() + node->first();
    count(mask, 2, in_near, in_far);
    near->node = children + back, near->mask = in_near;
    far->node = children + 1 - back, far->mask = in_far;
    return next->mask != 0 ? next : top;
  }

  /// A node of one child, with planes on both sides of it.
  ARBORETUM_INLINE Entry* clip(Entry* top, unsigned axis, unsigned back) const {
    const bih::Node* const node = top->node;
    const Mask in = in_lanes(top->mask, [&](int k) {
      const F low = max_x86(at_begin(node->clip[back], axis, k), F::load(top->low + k)),
              high = min_x86(at_end(node->clip[1 - back], axis, k), F::load(top->high + k));
      low.store(top->low + k), high.store(top->high + k);
      return low <= high;
    });
    count(top->mask, 1, in, 0);
    top->node = tree_.nodes() + node->first(), top->mask = in;
    return top;
  }

  /// The rays of `mask` visit a node, each tested against its `boxes` children.
  void count([[maybe_unused]] Mask mask, [[maybe_unused]] unsigned boxes, [[maybe_unused]] Mask first,
             [[maybe_unused]] Mask second) const {
    if constexpr (Counting::kCounting) {
      Base::count_node(mask, boxes);
      for (; mask; mask &= mask - 1) {
        const int i = __builtin_ctzll(mask);
        counting_.met(unsigned(first >> i & 1u) + unsigned(second >> i & 1u));
      }
    }
  }

  const bih::Bih& tree_;
  const bool padded_;
  BatchStack<Entry, 64> stack_;
  IntervalStack single_stack_;
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
