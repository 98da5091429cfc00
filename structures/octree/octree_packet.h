// Packets: up to 64 rays go through an octree together, with a mask of those that are in a cell.
//
// Rays that share an octant share the order of children (octree_single.h), and so one traversal; a packet of mixed
// signs is one masked traversal an octant. The three planes of an axis are the same for all rays of a cell: each ray
// meets them in a lane, and then each child is three selections and a comparison. A child waits on the stack with its
// rays; where no more than `threshold` are left in a cell they go on alone.
//
// A ray's tests are those of octree_single.h, operation by operation, so with `padded` boxes its answer is the same bit
// for bit: it visits the leaves that it would visit alone, and some that begin beyond its nearest hit.
#pragma once

#include "structures/leaves/leaf_lists_packet.h"
#include "structures/octree/octree_single.h"
#include "traversal/box_rays.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// W rays a register. `fast` and `padded` are one class with other constants.
template <int W, class Leaves, bool AnyHit, class Counting>
class OctreePackets : private ListedPacketLeaves<W, Leaves, AnyHit, Counting, BoxRays> {
  using Base = ListedPacketLeaves<W, Leaves, AnyHit, Counting, BoxRays>;

 public:
  using Base::best, Base::set_width, Base::times_alone;

  OctreePackets(const octree::Octree& tree, const KernelRow& row, Counting counting)
      : Base(row, tree.leaves(), counting), tree_(tree), padded_(row.box == "padded") {}

  /// Traces `rays`, 1 to kMost; their hits are then in best().
  void trace(const RayBatch& rays, int threshold) {
    Base::trace(
        rays, threshold,
        [&](int count, const auto& ray_at, const auto& each) {
          lanes_.template prepare<W, 8>(count, ray_at, padded_, BoxPad{tree_.max_coordinate()}, each);
        },
        [&](Mask mask, unsigned octant) { traverse(mask, octant); });
  }

 private:
  using typename Base::Mask;
  using F = vf<W>;
  using Base::active_, Base::best_, Base::chunks_, Base::counting_, Base::lanes_, Base::last_leaf_, Base::rays_;

  struct Entry {
    OctreeCell cell;
    Mask mask;
    float first;  ///< no ray enters it before
  };

  void traverse(Mask group, unsigned octant) {
    const octree::Node* const nodes = tree_.nodes();
    Entry* const stack = stack_;
    Entry* top = stack;
    Entry e{{{0, 0, 0, 0}, nodes[0], 0}, group, 0.0f};
    float last = Base::span_of_t(group).high;
    Base::forget_leaves();
    for (;;) {
      if (e.cell.node.mask == 0) {
        if (const Mask rays = Base::new_to(e.cell.node.first, e.mask); rays != 0) {
          Base::leaf(e.cell.node.first, rays);
          if constexpr (!AnyHit) last = Base::span_of_t(group).high;
        }
      } else if (Base::few(e.mask)) {
        Base::go_on_alone(e.mask, [&](int i, auto& visits) {
          const auto of = [i](const auto& axes) { return Vec3f{axes[0][i], axes[1][i], axes[2][i]}; };
          return search_octree<AnyHit>(tree_, OctreeRay(of(lanes_.r), of(lanes_.near), of(lanes_.far)), e.cell,
                                       rays_[i].tnear, best_[i], last_leaf_[i], counting_, visits);
        });
        if constexpr (!AnyHit) last = Base::span_of_t(group).high;
      } else {
        Mask in[8] = {};
        float first[8];
        const OctreePlanes planes(tree_.cube(), e.cell, vm<4>::from_bits(octant));
        children(planes, permute_by_octant(e.cell.node.mask, octant), e.mask, in, first);
        count(e, in);
        const octree::Node* const children = nodes + e.cell.node.first;
        for (unsigned i = 0; i < 8; ++i) {  // the one that is visited first on top
          const unsigned number = AnyHit ? i : 7 - i;
          if (in[number] == 0) continue;
          *top++ = {planes.child(e.cell, children, number ^ octant), in[number], first[number]};
        }
      }
      do {
        if (top == stack) return;
        e = *--top;
        if constexpr (AnyHit) e.mask &= active_;
      } while (e.mask == 0 || (!AnyHit && e.first > last));
    }
  }

  /// The rays of `mask` that are in each of the children that exist, by their number as the rays meet them, and where
  /// the first of those enters it.
  ARBORETUM_INLINE void children(const OctreePlanes& planes, unsigned exist, Mask mask, Mask (&in)[8],
                                 float (&first)[8]) const {
    [[maybe_unused]] F earliest[8];
    if constexpr (!AnyHit) {
      for (F& f : earliest) f = F(std::numeric_limits<float>::infinity());
    }
    alignas(16) float in_plane[4], middle[4], out_plane[4];
    planes.in.store(in_plane), planes.middle.store(middle), planes.out.store(out_plane);
    for (int c = 0; c < chunks_; ++c) {
      const unsigned here = Base::lanes_of(mask, c);
      if (here == 0) continue;
      const int k = c * W;
      F enter[3][2], leave[3][2];  // of the halves that a ray comes to first and last
      for (int a = 0; a < 3; ++a) {
        const F r = F::load(lanes_.r[a] + k), near = F::load(lanes_.near[a] + k), far = F::load(lanes_.far[a] + k);
        enter[a][0] = plane_distance(F(in_plane[a]), r, near), enter[a][1] = plane_distance(F(middle[a]), r, near);
        leave[a][0] = plane_distance(F(middle[a]), r, far), leave[a][1] = plane_distance(F(out_plane[a]), r, far);
      }
      const F tnear = F::load(lanes_.rays.tnear + k), t = F::load(lanes_.t + k);
      for (unsigned rest = exist; rest; rest &= rest - 1) {
        const auto number = unsigned(__builtin_ctz(rest));
        const unsigned x = number & 1u, y = number >> 1 & 1u, z = number >> 2;
        const F entry = max_x86(max_x86(enter[0][x], enter[1][y]), max_x86(enter[2][z], tnear));
        const F exit = min_x86(min_x86(leave[0][x], leave[1][y]), min_x86(leave[2][z], t));
        const vm<W> meets = (entry <= exit) & vm<W>::from_bits(here);
        in[number] |= Mask(meets.bits()) << k;
        if constexpr (!AnyHit) earliest[number] = min_x86(select(meets, entry, earliest[number]), earliest[number]);
      }
    }
    for (unsigned rest = exist; rest; rest &= rest - 1) {
      const auto number = unsigned(__builtin_ctz(rest));
      first[number] = 0.0f;
      if constexpr (!AnyHit) first[number] = reduce_min(earliest[number]);
    }
  }

  /// The rays of a cell are tested against each of its children.
  void count([[maybe_unused]] const Entry& e, [[maybe_unused]] const Mask (&in)[8]) const {
    if constexpr (Counting::kCounting) {
      Base::count_node(e.mask, unsigned(__builtin_popcount(e.cell.node.mask)));
      for (Mask rest = e.mask; rest; rest &= rest - 1) {
        unsigned met = 0;
        for (Mask child : in) met += unsigned(child >> __builtin_ctzll(rest) & 1u);
        counting_.met(met);
      }
    }
  }

  const octree::Octree& tree_;
  const bool padded_;
  Entry stack_[kMostOctreeCells];
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
