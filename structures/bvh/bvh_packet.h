// Packets: up to 64 rays go through a wide BVH together, with masks of those that are still in it.
//
// Rays that share an octant share one traversal; a packet of mixed signs is one masked copy an octant. A node's N
// children are first tested at once against an interval that holds all rays of the packet, then each that is left
// against the rays, W at a time, with the very arithmetic of single rays. Children go on the stack with the mask of
// their rays, nearest on top by the interval's entry. Where no more than `threshold` rays are in a node they go on
// alone, with all N children in lanes, and the packet with what is left on its stack.
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
// Without FMA r may be infinite; such a packet has no interval test. Rays with a common end instead of a common origin,
// as those towards a point light, are bounded from there.
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
  using typename Base::Mask;
  using F = vf<W>;
  using Base::active_, Base::best_, Base::chunks_, Base::counting_, Base::form_, Base::lanes_, Base::leaves_,
      Base::range, Base::rays_, Base::spread_;
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
    float r_low[3], r_high[3], near_origin[3], far_origin[3], pad[3];
    float tnear, earlier, later;
    bool usable, from_end;
    unsigned near[3];  ///< the near planes; the far one of axis a is 4 a + 1 less that
  };

  /// Bounds along one axis.
  struct Bounds {
    float low, high;
    [[nodiscard]] float largest() const { return -low > high ? -low : high; }
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

  Interval interval_of(Mask mask) {
    Interval v;
    v.usable = (mask & lanes_.overflowed) == 0;
    Bounds r[3], o[3];
    float unused;
    range(lanes_.first, mask, v.tnear, unused);
    if constexpr (kMoves) range(times_.of_ray, mask, times_.first, times_.last);
    for (int a = 0; a < 3; ++a) {
      range(lanes_.r[a], mask, r[a].low, r[a].high), range(lanes_.rays.origin[a], mask, o[a].low, o[a].high);
    }
    float size[3];  // 2^-20 of it, times r, is the pad
    for (int a = 0; a < 3; ++a) size[a] = max_coordinate_ + o[a].largest();
    spread_.reach = 0.0f;
    v.from_end = false;
    if constexpr (AnyHit) {
      if (v.usable) take_common_end(mask, v, o, size);
    }
    for (int a = 0; a < 3; ++a) {
      const bool negative = __builtin_signbit(r[a].low) != 0;
      v.r_low[a] = r[a].low, v.r_high[a] = r[a].high;
      v.near_origin[a] = negative ? o[a].low : o[a].high, v.far_origin[a] = negative ? o[a].high : o[a].low;
      // In this order: 2^-20 of a tiny scene may be nothing.
      v.pad[a] = 0x1p-20f * (size[a] * (negative ? -r[a].low : r[a].high)) + 2.0f * BoxPad::kLeast;
      v.near[a] = unsigned(2 * a + negative);
      v.usable &= v.pad[a] < std::numeric_limits<float>::infinity();
      Base::set_axis(a, o[a].low, o[a].high, mask);
    }
    // Distances that count from a ray's end are negative.
    v.earlier = v.from_end ? 1.0f + kSlack : 1.0f - kSlack, v.later = v.from_end ? 1.0f - kSlack : 1.0f + kSlack;
    return v;
  }
  static constexpr float kSlack = 0x1p-21f;

  /// The product and the sum of o + tfar d round by less than 2^-22 (|o| + |end|) together, or, where they are
  /// subnormal, by less than 2^-126.
  static float rounding(const Bounds& o, const Bounds& end) {
    return 0x1p-21f * (o.largest() + end.largest()) + 0x1p-126f;
  }

  /// Rays towards a light have no common origin, but their ends o + tfar d lie close together. Then the bounds of the
  /// ends take the place of the origins', and distances count from a ray's end, s = t - tfar: it meets a plane b at s =
  /// (b - end) r.
  void take_common_end(Mask mask, Interval& v, Bounds (&o)[3], float (&size)[3]) {
    Bounds t, end[3];
    range(lanes_.t, mask, t.low, t.high);
    if (!(t.high < std::numeric_limits<float>::infinity())) return;
    float origins = 0.0f, ends = 0.0f, largest = 0.0f;
    for (int a = 0; a < 3; ++a) {
      alignas(64) float at[kMost];
      for (int k = 0; k < chunks_ * W; k += W)
        (F::load(lanes_.rays.origin[a] + k) + F::load(lanes_.t + k) * F::load(lanes_.rays.direction[a] + k))
            .store(at + k);
      range(at, mask, end[a].low, end[a].high);
      const float most = o[a].largest() > end[a].largest() ? o[a].largest() : end[a].largest();
      largest = most > largest ? most : largest;
      origins += o[a].high - o[a].low, ends += end[a].high - end[a].low + 2.0f * rounding(o[a], end[a]);
    }
    if (!(ends < 0.25f * origins)) return;
    v.from_end = true;
    // What is computed from `end` is off like what is computed from `o` above. Where the direction is as good as 0
    // along an axis, r is not its reciprocal but 2^60 / |d|max, and s is off by up to tfar <= 2 largest / |d|max: the
    // width is of the largest coordinate of any axis, 2^-19 of which times that r is beyond it.
    for (int a = 0; a < 3; ++a) {
      const float wide = rounding(o[a], end[a]);
      const float up = end[a].high - o[a].low, down = o[a].high - end[a].low;
      spread_.reach += up > down ? up : down;
      o[a] = {end[a].low - wide, end[a].high + wide};
      size[a] = 2.0f * (max_coordinate_ + largest);
    }
    v.tnear = v.tnear - t.high * (1.0f + 0x1p-20f);
  }

  /// Planes k of all children; where they move, as far out as they are for any ray of the packet.
  ARBORETUM_INLINE Children planes(const std::byte* node, unsigned k) const {
    if constexpr (kMoves) {
      return Planes::planes(node, k, times_.first, times_.last);
    } else {
      return Planes::planes(node, k);
    }
  }

  /// The children that some ray of the packet may meet, and where it enters them at the earliest.
  ARBORETUM_INLINE unsigned children_met(const Interval& v, const std::byte* node, float tfar, Children& entry) const {
    Children near(v.tnear), far(tfar);
    for (int a = 0; a < 3; ++a) {
      const Children low(v.r_low[a]), high(v.r_high[a]), pad(v.pad[a]);
      const Children n = planes(node, v.near[a]) - Children(v.near_origin[a]);
      const Children f = planes(node, unsigned(4 * a + 1) - v.near[a]) - Children(v.far_origin[a]);
      near = max_x86(min_x86(n * low, n * high) - pad, near);
      far = min_x86(max_x86(f * low, f * high) + pad, far);
    }
    entry = near * Children(v.earlier);
    const unsigned bits = (entry <= far * Children(v.later)).bits();
    return N == kLanes ? bits : bits & ((1u << N) - 1u);
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
    bool from_end = false;
    if constexpr (!Mixed) {
      interval = interval_of(group), from_end = interval.from_end;
      Base::look_for_common_origin(group);
    }
    float tfar = from_end ? 0.0f : Base::farthest(group);
    Entry* const stack = stack_.data();
    Entry* top = stack;
    typename Counting::Depths depths{typename Counting::Depth{}};
    Entry e{root_, 0.0f, group};
    for (;;) {
      while (!bvh::is_leaf(e.reference)) {
        if (Base::few(e.mask)) {
          Base::go_on_alone(e.mask, [&](int i, auto& ray) { return alone(i, ray, e.reference, depths.current()); });
          if constexpr (!AnyHit) tfar = Base::farthest(group);
          goto pop;
        }
        const std::byte* node = base_ + bvh::offset_of(e.reference);
        const PacketNode<Format> read(node);
        alignas(64) float t[kLanes];
        unsigned hit;
        if constexpr (Mixed) {
          hit = (1u << Format::boxes(node)) - 1u;
        } else {
          Children entry;
          if (__builtin_expect(interval.usable, 1)) {
            hit = children_met(interval, read.planes, tfar, entry);
          } else {
            entry = Children(interval.tnear);
            hit = (1u << Format::boxes(node)) - 1u;
          }
          entry.store(t);
        }
        Entry* const bottom = top;
        [[maybe_unused]] MetChildren met;
        [[maybe_unused]] const unsigned tested = hit;
        for (; hit; hit &= hit - 1) {
          const int i = __builtin_ctz(hit);
          const Mask mask =
              Mixed ? mixed_rays_met(read.planes, i, e.mask, t[i]) : rays_met(interval.near, read.planes, i, e.mask);
          if (mask == 0) continue;
          met.add(mask);
          const bvh::NodeReference child = Format::children(node)[i * Format::kStride];
          prefetch_lines<kPrefetchLines>(base_ + bvh::offset_of(child));
          Entry* p = top++;
          if constexpr (!AnyHit) {
            for (; p != bottom && p[-1].t < t[i]; --p) *p = p[-1];
          }
          *p = {child, t[i], mask};
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
      if constexpr (!AnyHit) tfar = Base::farthest(group);
    pop:
      for (;;) {
        if (top == stack) return;
        e = *--top;
        depths.pop(top - stack);
        if constexpr (AnyHit) e.mask &= active_;
        if (e.mask != 0 && (AnyHit || e.t <= tfar)) break;
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
