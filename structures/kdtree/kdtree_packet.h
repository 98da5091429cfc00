// Packets: up to 64 rays go through a kd-tree together (Wald, Slusallek, Benthin and Wagner, "Interactive Rendering
// with Coherent Ray Tracing", Eurographics 2001), each with an interval of t of its own in a lane and a bit in the mask
// of those that are in a cell.
//
// Rays that share an octant share near and far on every axis, and so one traversal; a packet of mixed signs is one
// masked traversal an octant. A plane is tested in two steps, the first after Reshetov, Soupikov and Hurley
// ("Multi-Level Ray Tracing Algorithm", SIGGRAPH 2005): where the interval of distances at which any ray of the packet
// meets it lies before or behind all that is left of the rays, they all go one way, and none of their intervals
// changes. Else each ray is tested, W at a time. A far side (any hit: a near side) waits on the stack with its rays and
// their intervals. Where
// no more than `threshold` rays are left they go on alone (kdtree_single.h).
//
// A ray's own tests are those of kdtree_single.h, operation by operation, and its cells come in the same order. So it
// visits just the cells that it would visit alone, and its answer is the same bit for bit, with `fast` planes, too.
// NaN, from values beyond float's range, is a ray's own affair: it visits both sides, whatever lies in other lanes.
//
// The packet's interval. With r and o of the rays within [r0, r1] and [o0, o1], r of one sign, a plane at s is met at
// (s - o) r, whose ends are products of ends. What a ray computes is off by its pad, 8 u (M + |o|)|r|, and by the
// roundings of kdtree_single.h, 5 u (M + |o|)|r|; the interval's own roundings are 4 u (M + |o|)|r|: it is widened by
// 2^-19 (M + |o|)|r| = 32 u (M + |o|)|r|, and for planes beyond M (structures/box_pads.h) by 8 u of the distance, to
// which what they are rounded by more is relative. Where that is not far below float's range (a ray that gets r = 2^60
// / |d|max may have such an r) there is no interval, and all rays are tested everywhere.
#pragma once

#include "structures/kdtree/kdtree_single.h"
#include "traversal/packet_leaves.h"
#include "traversal/prefetch.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Rays side by side with the constants of KdRay, computed W rays at a time by its operations, so they are the same
/// bits.
struct KdLanes : LaneRays {
  alignas(64) float r[3][kMost], enter[3][kMost], leave[3][kMost];
  std::uint64_t overflowed;  ///< those of which an axis is left out

  /// As LaneRays::prepare(). `pad`: KdRay::kPad, or 0 for `fast` planes.
  template <int W, class RayAt, class Each>
  ARBORETUM_INLINE void prepare(int count, const RayAt& ray_at, float pad, float max_coordinate, const Each& each) {
    overflowed = 0;
    LaneRays::prepare<W>(count, ray_at, [&](int k) {
      constants<W>(k, pad, max_coordinate);
      each(k);
    });
  }

 private:
  template <int W>
  ARBORETUM_INLINE void constants(int k, float pad, float max_coordinate) {
    using F = vf<W>;
    const F d[3] = {F::load(rays.direction[0] + k), F::load(rays.direction[1] + k), F::load(rays.direction[2] + k)};
    const F o[3] = {F::load(rays.origin[0] + k), F::load(rays.origin[1] + k), F::load(rays.origin[2] + k)};
    const F largest = largest_component(d[0], d[1], d[2]);
    const auto origin = [&] { return largest_component(o[0], o[1], o[2]); };
    for (int a = 0; a < 3; ++a) {
      F reciprocal, in, out;
      const vm<W> fits = KdRay::constants(o[a], d[a], largest, origin, max_coordinate, pad, reciprocal, in, out);
      reciprocal.store(r[a] + k), in.store(enter[a] + k), out.store(leave[a] + k);
      overflowed |= std::uint64_t((~fits).bits()) << k;
    }
  }
};

/// `fast` and `padded` are one class with other constants.
template <int W, class Leaves, bool AnyHit, class Counting>
class KdPackets : private PacketLeaves<W, Leaves, AnyHit, Counting, KdLanes> {
  using Base = PacketLeaves<W, Leaves, AnyHit, Counting, KdLanes>;

 public:
  using Base::best, Base::set_width, Base::times_alone;

  KdPackets(const kdtree::KdTree& tree, const KernelRow& row, Counting counting)
      : Base(row, Leaves(row, tree.vertices()), counting), base_(tree.base()),
        root_(__builtin_bit_cast(std::uint64_t, tree.root())), bounds_(tree.bounds()),
        max_coordinate_(tree.max_coordinate()), pad_(row.box == "padded" ? KdRay::kPad : 0.0f),
        stack_(tree.stack_entries()), single_stack_(tree.stack_entries()) {}

  /// Traces `rays`, 1 to kMost; their hits are then in best().
  void trace(const RayBatch& rays, int threshold) {
    Base::trace(
        rays, threshold,
        [&](int count, const auto& ray_at, const auto& each) {
          lanes_.template prepare<W>(count, ray_at, pad_, max_coordinate_, each);
        },
        [&](Mask mask, unsigned octant) { traverse(mask, octant); });
  }

 private:
  using typename Base::Mask;
  using F = vf<W>;
  using Base::active_, Base::best_, Base::chunks_, Base::counting_, Base::form_, Base::kMost, Base::lanes_,
      Base::leaves_, Base::rays_;

  /// A cell that waits, or the one at hand: its rays, where they enter and leave it, and bounds of both for all of
  /// them.
  struct alignas(64) Cell {
    float begin[kMost], end[kMost];
    std::uint64_t node;
    Mask mask;
    float first, last;
  };

  /// One side of a plane: its rays, and bounds of where these enter and leave it.
  struct Side {
    std::uint64_t node;
    Mask rays;
    float first, last;
    bool exists;
  };

  /// Bounds of a group of rays by axis.
  struct Interval {
    alignas(16) float r0[4], r1[4], low_origin[4], high_origin[4], pad[4];
    bool usable;

    /// No ray meets the plane before `low` or behind `high`, padded or not. The pad makes good what is rounded where
    /// the plane is no further than max_coordinate_; where it is (structures/box_pads.h), 8 u of the distance does.
    ARBORETUM_INLINE void distances(float plane, unsigned axis, float& low, float& high) const {
      const float a = plane - low_origin[axis], b = plane - high_origin[axis];
      const float a0 = a * r0[axis], a1 = a * r1[axis], b0 = b * r0[axis], b1 = b * r1[axis];
      low = (a0 < a1 ? a0 : a1) - pad[axis], high = (b0 > b1 ? b0 : b1) + pad[axis];
      low -= 0x1p-21f * __builtin_fabsf(low), high += 0x1p-21f * __builtin_fabsf(high);
    }
  };

  /// Also tells the leaves what they need of the group. Rays that fill two registers or less are not worth an interval
  /// of planes.
  Interval interval_of(Mask group) {
    Interval v;
    v.usable = chunks_ > 2 && (lanes_.overflowed & group) == 0;
    if (!v.usable && !Leaves::kRaysInLanes) return v;
    const AxisBounds r = Base::bounds(group, lanes_.r, lanes_.r[0]);
    const AxisBounds o = Base::bounds(group, lanes_.rays.origin, lanes_.rays.origin[0]);
    const vm<4> down = sign_bits(r.low) < vi<4>(0);
    const vf<4> pad = vf<4>(0x1p-19f) * ((vf<4>(max_coordinate_) + o.largest()) * select(down, -r.low, r.high)) +
                      vf<4>(0x1p-98f);  // in this order, as in BVHs
    v.usable &= all(pad < vf<4>(0x1p100f));
    r.low.store(v.r0), r.high.store(v.r1), pad.store(v.pad);
    select(down, o.low, o.high).store(v.low_origin), select(down, o.high, o.low).store(v.high_origin);
    Base::set_spread(o, group);
    Base::look_for_common_origin(group, all(o.low == o.high));
    return v;
  }

  /// The octant's rays into the root's cell, as KdRay::clip().
  void clip(Mask group, const unsigned (&far)[3], Cell& cell) const {
    cell.mask = 0;
    for (int c = 0; c < chunks_; ++c) {
      const unsigned in = Base::lanes_of(group, c);
      if (in == 0) continue;
      const int k = c * W;
      F begin = F::load(lanes_.rays.tnear + k), end = F::load(lanes_.t + k);
      for (int a = 0; a < 3; ++a) {
        const float low = (&bounds_.lower.x)[a], high = (&bounds_.upper.x)[a];
        const F r = F::load(lanes_.r[a] + k);
        begin = max_x86(msub(F(far[a] ? low : high), r, F::load(lanes_.enter[a] + k)), begin);
        end = min_x86(msub(F(far[a] ? high : low), r, F::load(lanes_.leave[a] + k)), end);
      }
      begin.store(cell.begin + k), end.store(cell.end + k);
      cell.mask |= Mask((~(begin > end)).bits() & in) << k;
    }
  }

  /// The rays of a cell at a plane: those that are in the near side and in the far side. Where both are asked for, the
  /// cell becomes the side that waits, the one behind it on the stack the side that is next; one side alone is the cell
  /// itself.
  template <bool Near, bool Far>
  ARBORETUM_INLINE void divide(Cell* cell, float plane, unsigned axis, Mask mask, Mask& near, Mask& far) const {
    near = far = 0;
    constexpr bool kBoth = Near && Far;
    Cell* const near_cell = kBoth && !AnyHit ? cell + 1 : cell;
    Cell* const far_cell = kBoth && AnyHit ? cell + 1 : cell;
    const F s(plane);
    for (int c = 0; c < chunks_; ++c) {
      const unsigned in = Base::lanes_of(mask, c);
      if (in == 0) continue;
      const int k = c * W;
      const F r = F::load(lanes_.r[axis] + k), begin = F::load(cell->begin + k), end = F::load(cell->end + k);
      if constexpr (Near) {
        const F leave = msub(s, r, F::load(lanes_.leave[axis] + k));
        near |= Mask((~(leave < begin)).bits() & in) << k;
        if constexpr (kBoth && !AnyHit) begin.store(near_cell->begin + k);
        min_x86(leave, end).store(near_cell->end + k);
      }
      if constexpr (Far) {
        const F enter = msub(s, r, F::load(lanes_.enter[axis] + k));
        far |= Mask((~(enter > end)).bits() & in) << k;
        if constexpr (kBoth && AnyHit) end.store(far_cell->end + k);
        max_x86(enter, begin).store(far_cell->begin + k);
      }
    }
  }

  void traverse(Mask group, unsigned octant) {
    unsigned far_side[3];  // byte offset within a pair of the child that rays come to last
    for (unsigned a = 0; a < 3; ++a) far_side[a] = octant >> a & 1u ? 0u : 8u;
    const Interval interval = interval_of(group);
    Cell* const stack = stack_.data();
    Cell* top = stack;  // the cell at hand; those below wait
    typename Counting::Depths depths{typename Counting::Depth{}};
    clip(group, far_side, *top);
    Mask mask = top->mask;
    if (mask == 0) return;
    std::uint64_t node = root_;
    float first = -std::numeric_limits<float>::infinity(), last = -first;
    if (interval.usable) shorten(*top, mask, first, last);
    for (;;) {
      for (;;) {
        const auto link = std::uint32_t(node >> 32);
        const unsigned axis = link & 3u;
        if (axis == 3) break;
        if (Base::few(mask)) {
          Base::go_on_alone(mask,
                            [&](int i, auto& ray) { return alone(i, ray, node, *top, far_side, depths.current()); });
          goto pop;
        }
        const float plane = __builtin_bit_cast(float, std::uint32_t(node));
        const std::byte* pair = place_in_kdtree(base_, node);
        std::uint64_t near, far;
        std::memcpy(&near, pair + (far_side[axis] ^ 8u), 8), std::memcpy(&far, pair + far_side[axis], 8);
        const bool has_near = near != kdtree::kEmptyCell, has_far = far != kdtree::kEmptyCell;
        float low = first, high = last;
        if (__builtin_expect(interval.usable, 1)) {
          interval.distances(plane, axis, low, high);
          if (low > last || high < first) {
            const bool has = low > last ? has_near : has_far;
            count(mask, 2, 0, has ? mask : 0, 0, depths.current());
            if (!has) goto pop;
            depths.descend();
            node = low > last ? near : far;
            continue;
          }
        }
        Mask in_near, in_far;
        if (has_near & has_far) {
          divide<true, true>(top, plane, axis, mask, in_near, in_far);
        } else if (has_near) {
          divide<true, false>(top, plane, axis, mask, in_near, in_far);
        } else {
          divide<false, true>(top, plane, axis, mask, in_near, in_far);
        }
        count(mask, interval.usable ? 2 : 0, unsigned(has_near) + unsigned(has_far), in_near, in_far, depths.current());
        const Side near_part{near, in_near, first, high < last ? high : last, has_near};
        const Side far_part{far, in_far, low > first ? low : first, last, has_far};
        const Side &next = AnyHit ? far_part : near_part, &later = AnyHit ? near_part : far_part;
        const bool skip = next.rays == 0;
        if (skip && later.rays == 0) goto pop;
        if (!skip && later.exists) {  // waits, though it be without rays
          prefetch(later.node);
          depths.push(top - stack, top - stack + 1);
          top->node = later.node, top->mask = later.rays, top->first = later.first, top->last = later.last;
          ++top;
        }
        depths.descend();
        const Side& taken = skip ? later : next;
        node = taken.node, mask = taken.rays, first = taken.first, last = taken.last;
      }
      if (const auto blocks = std::uint32_t(node); blocks != 0) Base::leaf(place_in_kdtree(base_, node), blocks, mask);
    pop:
      do {
        if (top == stack) return;
        --top;
        mask = top->mask;
        if constexpr (AnyHit) {
          mask &= active_, first = top->first, last = top->last;
        } else if (mask != 0) {
          mask = shorten(*top, mask, first, last);
        }
      } while (mask == 0);
      depths.pop(top - stack);
      node = top->node;
    }
  }

  /// Ends the rays of a cell at what they have met. Returns those that enter it before, and bounds of where they enter
  /// and leave.
  ARBORETUM_INLINE Mask shorten(Cell& cell, Mask mask, float& first, float& last) const {
    const F infinity(std::numeric_limits<float>::infinity());
    F least = infinity, most = -infinity;
    Mask left = 0;
    for (int c = 0; c < chunks_; ++c) {
      const unsigned in = Base::lanes_of(mask, c);
      if (in == 0) continue;
      const int k = c * W;
      const F begin = F::load(cell.begin + k), t = F::load(lanes_.t + k), end = min_x86(F::load(cell.end + k), t);
      end.store(cell.end + k);
      const vm<W> here = ~(begin > t) & vm<W>::from_bits(in);
      left |= Mask(here.bits()) << k;
      least = min_x86(least, select(here, begin, infinity)), most = max_x86(most, select(here, end, -infinity));
    }
    first = reduce_min(least), last = -reduce_min(-most);
    return left;
  }

  template <class RayData>
  bool alone(int i, RayData& ray, std::uint64_t node, const Cell& cell, const unsigned (&far_side)[3],
             typename Counting::Depth depth) {
    KdRay planes;
    for (int a = 0; a < 3; ++a)
      planes.r[a] = lanes_.r[a][i], planes.enter[a] = lanes_.enter[a][i], planes.leave[a] = lanes_.leave[a][i],
      planes.far[a] = far_side[a];
    return search(node, cell.begin[i], cell.end[i], planes, rays_[i], ray, best_[i], depth);
  }
  __attribute__((noinline)) bool search(std::uint64_t node, float begin, float end, const KdRay& planes, const Ray& ray,
                                        typename Leaves::RayData& data, NearestHit& best,
                                        typename Counting::Depth depth) {
    return search_kdtree<AnyHit>(base_, node, begin, end, planes, single_stack_.data(), ray, leaves_, data, best, form_,
                                 counting_, depth);
  }

  /// The rays of `mask` visit a node: of its two cells `together` are tested against the interval of all, then `each`
  /// against each ray.
  void count([[maybe_unused]] Mask mask, [[maybe_unused]] unsigned together, [[maybe_unused]] unsigned each,
             [[maybe_unused]] Mask near, [[maybe_unused]] Mask far,
             [[maybe_unused]] typename Counting::Depth depth) const {
    if constexpr (Counting::kCounting) {
      const auto [lanes, active] = Base::count_node(mask, each);
      counting_.interval(together), counting_.at_depth(depth, lanes, active);
      for (; mask; mask &= mask - 1) {
        const int i = __builtin_ctzll(mask);
        counting_.met(unsigned(near >> i & 1u) + unsigned(far >> i & 1u));
      }
    }
  }

  ARBORETUM_INLINE void prefetch(std::uint64_t node) const { prefetch_lines<4>(place_in_kdtree(base_, node)); }

  const std::byte* base_;
  const std::uint64_t root_;
  const Bounds3f bounds_;
  const float max_coordinate_, pad_;
  BatchStack<Cell, 64> stack_;
  KdStack single_stack_;
};

/// What the wider packets have compiled in: one leaf, since each costs a unit seconds to compile.
using KdPacketLeaves =
    std::conditional_t<kRegisterWidth == 1, TypeList<>,
                       std::conditional_t<kRegisterWidth == 4, TypeList<CompiledLeaves<EdgeBlock<4>, MollerTrumbore>>,
                                          TypeList<CompiledLeaves<EdgeBlock<8>, MollerTrumbore>>>>;

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
