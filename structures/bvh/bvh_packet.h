// Packets: up to 64 rays go through a wide BVH together, with masks of those that are still in it.
//
// Rays that share an octant share one traversal; a packet of mixed signs is one masked copy an octant. A node's N
// children are first tested at once against an interval that holds all rays of the packet, then each that is left, but
// for those that the interval shows to be met by all of them, against the rays, W at a time, with the very arithmetic
// of single rays. Children go on the stack with the mask of their rays, nearest on top by the interval's entry. Where
// no more than `threshold` rays are in a node they go on alone, with all N children in lanes, and the packet with what
// is left on its stack.
//
// A small packet of many octants goes as one (`mix`): each lane with its own near planes, without the interval test;
// children then go on the stack by the first of their rays' entries.
//
// The interval test. With r = 1/d and o within the packet's bounds a plane b is met at (b - o) r, whose ends over the
// packet are products of ends. What a ray's own test computes is off it by less than 2^-20 (M + |o|)|r|
// (traversal/box_test.h: its pad and roundings are three quarters of that, the interval's own roundings less than the
// rest), by which the interval is widened: no child is lost that a ray's test takes. Planes may be beyond M
// (structures/box_pads.h): what they are rounded by more is relative to the distance that comes out, by which the last
// of the three entries and the first of the three exits are moved once more (Interval); the others do not matter.
// Moved the other way, an entry that is before an exit is so for every ray, whatever it rounds: that child is met by
// all. Without FMA r may be infinite; such a packet has no interval test. Rays with a common end instead of a common
// origin, as those towards a point light, are bounded from there.
//
// Every ray visits at least the leaves that it would visit alone, up to those that begin beyond its nearest hit. So
// with padded boxes the answers are those of single rays, bit for bit.
#pragma once

#include "structures/bvh/bvh_packet_nodes.h"
#include "traversal/box_rays.h"
#include "traversal/packet_leaves.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// W rays a register. `fast` and `padded` are one class: they differ in what rays bring with them (compile time).
template <class Format, int W, class Leaves, bool AnyHit, class Counting>
class BvhPackets : private PacketLeaves<W, Leaves, AnyHit, Counting, BoxRays> {
  using Base = PacketLeaves<W, Leaves, AnyHit, Counting, BoxRays>;

 public:
  using Base::best, Base::kMost, Base::set_width, Base::times_alone;

  BvhPackets(const bvh::BvhBase& tree, const KernelRow& row, Counting counting)
      : BvhPackets(tree, row, counting, leaves_of<Leaves>(tree, row), row.box == "padded", tree.max_coordinate()) {}
  /// With leaves that are there, and boxes padded, where they are, for that largest coordinate.
  BvhPackets(const bvh::BvhBase& tree, const KernelRow& row, Counting counting, const Leaves& leaves, bool padded,
             float max_coordinate)
      : Base(row, leaves, counting), base_(tree.base()), root_(tree.root()), max_coordinate_(max_coordinate),
        padded_(padded), stack_(tree.stack_entries()), single_stack_(tree.stack_entries()) {}

  /// Of packets of so many rays, the last of a batch fewer.
  void set_size(int rays_each) { may_mix_ = rays_each <= kMostMixed; }

  /// Traces `rays`, 1 to kMost; their hits are then in best().
  void trace(const RayBatch& rays, int threshold) {
    Base::trace(
        rays, threshold,
        [&](int count, const auto& ray_at, const auto& each) {
          lanes_.template prepare<W, N>(count, ray_at, padded_, BoxPad{max_coordinate_}, each);
          if constexpr (kMoves) times_.load(rays);
        },
        [&](Mask mask, unsigned) { traverse<false>(mask); },
        [&](unsigned octants) { return mix(octants, rays.size()); });
  }

 private:
  using typename Base::Mask, typename Base::Span;
  using F = vf<W>;
  using Base::active_, Base::best_, Base::chunks_, Base::counting_, Base::form_, Base::lanes_, Base::leaves_,
      Base::rays_, Base::spread_;
  static constexpr int N = Format::kBranching, kLanes = Format::kLanes;
  static constexpr bool kMoves = kBoxesMove<Format>;
  using Children = vf<kLanes>;
  using Planes = typename PacketNode<Format>::Planes;

  struct Entry {
    bvh::NodeReference reference;
    float t;
    Mask mask;
  };
  /// Bounds of a group of rays by axis: of 1/d, of the origin at the near and at the far planes, and what they are
  /// widened by. `earlier` and `later`: what entries and exits are scaled by, 8 u, for planes beyond max_coordinate_.
  struct Interval {
    alignas(16) float r_low[4], r_high[4], near_origin[4], far_origin[4], pad[4];
    float tnear, tfar;             ///< of all rays; tfar as they begin
    float last_tnear, first_tfar;  ///< the largest tnear, the smallest tfar
    float earlier, later;
    bool usable, from_end, one_origin;
    unsigned near[3];  ///< the near planes; the far one of axis a is 4 a + 1 less that
  };

  /// Packets of no more rays go through the tree as one where these are of so many octants or more: of four rays, of
  /// more (docs/performance/packets.md).
  static constexpr int kMostMixed = 16;
  static constexpr unsigned kMixedOfFour = 3, kMixedOfMore = 4;

  /// Traces the rays, which are of so many octants, as one where that is better than octant by octant; else returns
  /// false.
  ARBORETUM_INLINE bool mix(unsigned octants, std::size_t count) {
    if constexpr (Leaves::kRaysInLanes) {
      return false;  // those are packets of 32 and 64 rays
    } else {
      if (!may_mix_ || octants < (count > 4 ? kMixedOfMore : kMixedOfFour)) return false;
      for (int k = 0; k < chunks_ * W; k += W) {
        for (int a = 0; a < 3; ++a) {
          const vm<W> negative = sign_bits(F::load(lanes_.r[a] + k)) < vi<W>(0);
          const F near = F::load(lanes_.near[a] + k), far = F::load(lanes_.far[a] + k);
          select(negative, far, near).store(of_lower_[a] + k), select(negative, near, far).store(of_upper_[a] + k);
        }
      }
      traverse<true>(lanes_.valid);
      return true;
    }
  }

  /// By axis in lanes: what stands in the fourth one belongs to none.
  Interval interval_of(Mask mask) {
    Interval v;
    const AxisBounds r = Base::bounds(mask, lanes_.r, lanes_.first);
    AxisBounds o = Base::bounds(mask, lanes_.rays.origin, lanes_.t);
    if constexpr (kMoves) {
      const AxisBounds times = Base::bounds(mask, [&](int, int k) { return F::load(times_.of_ray + k); });
      times_.first = lane<0>(times.low), times_.last = lane<0>(times.high);
    }
    v.tnear = lane<3>(r.low), v.last_tnear = lane<3>(r.high);
    v.first_tfar = lane<3>(o.low), v.tfar = lane<3>(o.high);
    v.usable = (mask & lanes_.overflowed) == 0, v.from_end = false;
    v.one_origin = ((o.low == o.high).bits() & kAxes) == kAxes;
    vf<4> size = vf<4>(max_coordinate_) + o.largest();  // 2^-20 of it, times r, is the pad
    spread_.reach = 0.0f;
    if constexpr (AnyHit) {
      if (v.usable) take_common_end(mask, v, o, size);
    }
    const vm<4> negative = sign_bits(r.low) < vi<4>(0);
    // In this order: 2^-20 of a tiny scene may be nothing.
    const vf<4> pad = vf<4>(0x1p-20f) * (size * select(negative, -r.low, r.high)) + vf<4>(2.0f * BoxPad::kLeast);
    v.usable &= ((pad < vf<4>(std::numeric_limits<float>::infinity())).bits() & kAxes) == kAxes;
    r.low.store(v.r_low), r.high.store(v.r_high), pad.store(v.pad);
    select(negative, o.low, o.high).store(v.near_origin), select(negative, o.high, o.low).store(v.far_origin);
    for (unsigned a = 0; a < 3; ++a) v.near[a] = 2 * a + (negative.bits() >> a & 1u);
    // Distances that count from a ray's end are negative.
    v.earlier = v.from_end ? 1.0f + kSlack : 1.0f - kSlack, v.later = v.from_end ? 1.0f - kSlack : 1.0f + kSlack;
    Base::set_spread(o, mask);
    return v;
  }
  static constexpr unsigned kAxes = 7;
  static constexpr float kSlack = 0x1p-21f;

  /// Rays towards a light have no common origin, but their ends o + tfar d lie close together. Then the bounds of the
  /// ends take the place of the origins', and distances count from a ray's end, s = t - tfar: it meets a plane b at s =
  /// (b - end) r.
  ARBORETUM_INLINE void take_common_end(Mask mask, Interval& v, AxisBounds& o, vf<4>& size) {
    if (!(v.tfar < std::numeric_limits<float>::infinity())) return;
    const AxisBounds end = Base::bounds(mask, [&](int i, int k) {
      const int a = i < 3 ? i : 0;
      return F::load(lanes_.rays.origin[a] + k) + F::load(lanes_.t + k) * F::load(lanes_.rays.direction[a] + k);
    });
    const auto sum = [](vf<4> x) { return lane<0>(x) + lane<1>(x) + lane<2>(x); };
    const vf<4> most = o.largest(), end_most = end.largest();
    // The product and the sum of o + tfar d round by less than 2^-22 (|o| + |end|) together, or, where they are
    // subnormal, by less than 2^-126.
    const vf<4> wide = vf<4>(0x1p-21f) * (most + end_most) + vf<4>(0x1p-126f);
    if (!(sum(end.high - end.low + (wide + wide)) < 0.25f * sum(o.high - o.low))) return;
    v.from_end = true;
    // What is computed from `end` is off like what is computed from `o` above. Where the direction is as good as 0
    // along an axis, r is not its reciprocal but 2^60 / |d|max, and s is off by up to tfar <= 2 largest / |d|max: the
    // width is of the largest coordinate of any axis, 2^-19 of which times that r is beyond it.
    spread_.reach = sum(max_x86(end.high - o.low, o.high - end.low));
    o = {end.low - wide, end.high + wide};
    size = vf<4>(2.0f * (max_coordinate_ + reduce_max(xyzx(max_x86(most, end_most)))));
    v.tnear = v.tnear - v.tfar * (1.0f + 0x1p-20f);
    v.last_tnear = v.last_tnear - v.first_tfar * (1.0f - 0x1p-20f);
    v.first_tfar = v.tfar = 0.0f;
  }

  /// Planes k of all children; where they move, as far out as they are for any ray of the packet.
  ARBORETUM_INLINE Children planes(const std::byte* node, unsigned k) const {
    if constexpr (kMoves) {
      return Planes::planes(node, k, times_.first, times_.last);
    } else {
      return Planes::planes(node, k);
    }
  }

  /// The children that some ray of the packet may meet, where it enters them at the earliest, and of them those that
  /// all rays meet for certain, of which no ray's own test says otherwise. `t`: the rays' distances that count.
  ARBORETUM_INLINE unsigned children_met(const Interval& v, const std::byte* node, const Span& t, Children& entry,
                                         unsigned& by_all) const {
    Children near(v.tnear), far(t.high), last_in(v.last_tnear), first_out(t.low);
    for (int a = 0; a < 3; ++a) {
      const Children low(v.r_low[a]), high(v.r_high[a]), pad(v.pad[a]);
      const Children near_origin(v.near_origin[a]), far_origin(v.far_origin[a]);
      const Children near_planes = planes(node, v.near[a]), far_planes = planes(node, unsigned(4 * a + 1) - v.near[a]);
      const Children n = near_planes - near_origin, f = far_planes - far_origin;
      near = max_x86(min_x86(n * low, n * high) - pad, near);
      far = min_x86(max_x86(f * low, f * high) + pad, far);
      if constexpr (!kMoves) {
        const Children last = near_planes - far_origin, first = far_planes - near_origin;
        last_in = max_x86(max_x86(last * low, last * high) + pad, last_in);
        first_out = min_x86(min_x86(first * low, first * high) - pad, first_out);
      }
    }
    const Children earlier(v.earlier), later(v.later);
    entry = near * earlier;
    const unsigned bits = (entry <= far * later).bits() & ((1u << N) - 1u);
    by_all = kMoves ? 0 : (last_in * later <= first_out * earlier).bits() & bits;
    return bits;
  }

  /// Where the W rays from k on meet plane `plane` of child i; `c`: their offsets for it.
  ARBORETUM_INLINE F distance(const std::byte* node, unsigned plane, int i, F r, const float* c, int k) const {
    if constexpr (kMoves) {
      return Planes::template distance<F>(node, plane, i, r, F::load(c + k), F::load(times_.of_ray + k));
    } else {
      return Planes::template distance<F>(node, plane, i, r, F::load(c + k));
    }
  }

  /// Those of `mask`, of any octants, that meet child i, and where the first of them enters it. Of each lane these are
  /// the operations of its own octant.
  ARBORETUM_INLINE Mask mixed_rays_met(const std::byte* node, int i, Mask mask, float& entry) const {
    Mask met = 0;
    const F infinity(std::numeric_limits<float>::infinity());
    F first = infinity;
    for (int c = 0; c < chunks_; ++c) {
      const unsigned in = Base::lanes_of(mask, c);
      if (in == 0) continue;
      const int k = c * W;
      F near[3], far[3];
      for (unsigned a = 0; a < 3; ++a) {
        const F r = F::load(lanes_.r[a] + k);
        const vm<W> negative = sign_bits(r) < vi<W>(0);
        const F lower = distance(node, 2 * a, i, r, of_lower_[a], k),
                upper = distance(node, 2 * a + 1, i, r, of_upper_[a], k);
        near[a] = select(negative, upper, lower), far[a] = select(negative, lower, upper);
      }
      const F enter = max_x86(max_x86(near[0], near[1]), max_x86(near[2], F::load(lanes_.first + k)));
      const F leave = min_x86(min_x86(far[0], far[1]), min_x86(far[2], F::load(lanes_.t + k)));
      const unsigned inside = (enter <= leave).bits() & in;
      met |= Mask(inside) << k;
      first = min_x86(select(vm<W>::from_bits(inside), enter, infinity), first);
    }
    entry = reduce_min(first);
    return met;
  }

  /// Those of `mask` that meet child i.
  ARBORETUM_INLINE Mask rays_met(const unsigned (&near)[3], const std::byte* node, int i, Mask mask) const {
    Mask met = 0;
    for (int c = 0; c < chunks_; ++c) {
      const unsigned in = Base::lanes_of(mask, c);
      if (in == 0) continue;
      const int k = c * W;
      const F rx = F::load(lanes_.r[0] + k), ry = F::load(lanes_.r[1] + k), rz = F::load(lanes_.r[2] + k);
      const auto at = [&](unsigned plane, F r, const float* c) { return distance(node, plane, i, r, c, k); };
      const F enter = max_x86(max_x86(at(near[0], rx, lanes_.near[0]), at(near[1], ry, lanes_.near[1])),
                              max_x86(at(near[2], rz, lanes_.near[2]), F::load(lanes_.first + k)));
      const F leave = min_x86(min_x86(at(1 - near[0], rx, lanes_.far[0]), at(5 - near[1], ry, lanes_.far[1])),
                              min_x86(at(9 - near[2], rz, lanes_.far[2]), F::load(lanes_.t + k)));
      met |= Mask((enter <= leave).bits() & in) << k;
    }
    return met;
  }

  /// `Mixed`: rays of any octants; else all are of one.
  template <bool Mixed>
  void traverse(Mask group) {
    [[maybe_unused]] Interval interval;
    Span t;  // of the distances that count
    if constexpr (!Mixed) {
      interval = interval_of(group);
      Base::look_for_common_origin(group, interval.one_origin);
      t = {interval.first_tfar, interval.tfar};
    } else {
      t = Base::span_of_t(group);
    }
    Entry* const stack = stack_.data();
    Entry* top = stack;
    typename Counting::Depths depths{typename Counting::Depth{}};
    Entry e{root_, 0.0f, group};
    for (;;) {
      while (!bvh::is_leaf(e.reference)) {
        if (Base::few(e.mask)) {
          Base::go_on_alone(e.mask, [&](int i, auto& ray) { return alone(i, ray, e.reference, depths.current()); });
          if constexpr (!AnyHit) t = Base::span_of_t(group);
          goto pop;
        }
        const std::byte* node = base_ + bvh::offset_of(e.reference);
        const PacketNode<Format> read(node);
        alignas(64) float entries[kLanes];
        unsigned hit, by_all = 0;
        if constexpr (Mixed) {
          hit = (1u << Format::boxes(node)) - 1u;
        } else {
          Children entry;
          if (__builtin_expect(interval.usable, 1)) {
            hit = children_met(interval, read.planes, t, entry, by_all);
          } else {
            entry = Children(interval.tnear);
            hit = (1u << Format::boxes(node)) - 1u;
          }
          entry.store(entries);
        }
        Entry* const bottom = top;
        [[maybe_unused]] MetChildren met;
        [[maybe_unused]] const unsigned tested = hit & ~by_all;
        for (; hit; hit &= hit - 1) {
          const int i = __builtin_ctz(hit);
          Mask mask = e.mask;
          if constexpr (Mixed) {
            mask = mixed_rays_met(read.planes, i, mask, entries[i]);
          } else if ((by_all >> i & 1u) == 0) {
            mask = rays_met(interval.near, read.planes, i, mask);
          }
          if (mask == 0) continue;
          met.add(mask);
          const bvh::NodeReference child = Format::children(node)[i * Format::kStride];
          prefetch_lines<kPrefetchLines>(base_ + bvh::offset_of(child));
          Entry* p = top++;
          if constexpr (!AnyHit) {
            for (; p != bottom && p[-1].t < entries[i]; --p) *p = p[-1];
          }
          *p = {child, entries[i], mask};
        }
        if constexpr (Counting::kCounting) {
          if constexpr (!Mixed) {
            if (interval.usable) counting_.interval(Format::boxes(node));
          }
          count(e.mask, unsigned(__builtin_popcount(tested)), met, depths.current());
        }
        if (top == bottom) goto pop;
        depths.push(bottom - stack, top - stack);
        e = *--top;
        depths.pop(top - stack);
      }
      Base::leaf(base_ + bvh::offset_of(e.reference), bvh::block_count(e.reference), e.mask);
      if constexpr (!AnyHit) t = Base::span_of_t(group);
    pop:
      for (;;) {
        if (top == stack) return;
        e = *--top;
        depths.pop(top - stack);
        if constexpr (AnyHit) e.mask &= active_;
        if (e.mask != 0 && (AnyHit || e.t <= t.high)) break;
      }
    }
  }

  template <class Axes>
  static ARBORETUM_INLINE Vec3f of(const Axes& axes, int i) {
    return {axes[0][i], axes[1][i], axes[2][i]};
  }

  template <class RayData>
  bool alone(int i, RayData& ray, bvh::NodeReference reference, typename Counting::Depth depth) {
    const auto below = [&](auto padded) {
      const BoxRay<N, decltype(padded)::value> box(of(lanes_.r, i), of(lanes_.near, i), of(lanes_.far, i));
      const auto search = [&](auto... time) {
        return trace_below<Format, Leaves, decltype(padded)::value, AnyHit>(
            base_, reference, box, lanes_.first[i], rays_[i], leaves_, ray, best_[i], single_stack_.data(), form_,
            counting_, depth, time...);
      };
      if constexpr (kMoves) {
        return search(times_.of_ray[i]);
      } else {
        return search();
      }
    };
    return padded_ ? below(std::true_type{}) : below(std::false_type{});
  }

  /// How many children of a node each ray meets.
  struct WithMetChildren {
    std::uint8_t of_ray[kMost] = {};
    void add(Mask mask) {
      for (; mask; mask &= mask - 1) ++of_ray[__builtin_ctzll(mask)];
    }
  };
  struct NoMetChildren {
    ARBORETUM_INLINE void add(Mask) const {}
  };
  using MetChildren = std::conditional_t<Counting::kCounting, WithMetChildren, NoMetChildren>;

  /// The rays of `mask` visit a node, tested against those of its children that the interval test leaves.
  void count(Mask mask, unsigned tested, const MetChildren& met, typename Counting::Depth depth) const {
    const auto [lanes, active] = Base::count_node(mask, tested);
    counting_.at_depth(depth, lanes, active);
    for (; mask; mask &= mask - 1) counting_.met(met.of_ray[__builtin_ctzll(mask)]);
  }

  /// Where boxes move: the rays' times, within [0, 1], and between which those of an octant lie.
  struct Times {
    alignas(64) float of_ray[kMost];
    float first, last;
    void load(const RayBatch& rays) {
      // A register may be wider than the rays are many.
      for (std::size_t i = 0; i < ((rays.size() + 15) & ~std::size_t{15}); ++i)
        of_ray[i] = within_frames(i < rays.size() ? rays.time(i) : 0.0f);
    }
  };
  struct Nothing {};

  /// Offsets of mixed rays for lower and for upper planes, whichever of them a ray meets first.
  alignas(64) float of_lower_[3][Leaves::kRaysInLanes ? 1 : kMostMixed],
      of_upper_[3][Leaves::kRaysInLanes ? 1 : kMostMixed];
  const std::byte* base_;
  const bvh::NodeReference root_;
  const float max_coordinate_;
  const bool padded_;
  bool may_mix_ = false;
  [[no_unique_address]] std::conditional_t<kMoves, Times, Nothing> times_;
  BatchStack<Entry, 512> stack_;
  TraversalStack single_stack_;
};

/// As traversal/packet_rows.h wants it.
template <class Format>
struct BvhPacketFamily {
  using Structure = bvh::BvhBase;
  static constexpr bool kFewerLanes = true;
  static constexpr float kNear = 0.0f;
  template <int W, class Leaves, bool AnyHit, class Counting>
  using Packets = BvhPackets<Format, W, Leaves, AnyHit, Counting>;
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
