// Packets: up to 64 rays go through a wide BVH together, with masks of those that are still in it.
//
// Rays that share an octant share one traversal; a packet of mixed signs is one masked copy an octant. A node's N children are first tested
// at once against an interval that holds all rays of the packet, then each that is left against the rays, W at a time, with the very
// arithmetic of single rays. Children go on the stack with the mask of their rays, nearest on top by the interval's entry. Where no more
// than `threshold` rays are in a node they go on alone, with all N children in lanes, and the packet with what is left on its stack.
//
// The interval test. With r = 1/d and o within the packet's bounds a plane b is met at (b - o) r, whose ends over the packet are products of
// ends. What a ray's own test computes is off it by less than 2^-20 (M + |o|)|r| (traversal/box_test.h: its pad and roundings are
// three quarters of that, the interval's own roundings less than the rest), by which the interval is widened: no child is lost that a ray's test takes.
// Without FMA r may be infinite; such a packet has no interval test. Rays with a common end instead of a common origin, as those towards a point light, are bounded from there.
//
// Every ray visits at least the leaves that it would visit alone, up to those that begin beyond its nearest hit. So with padded boxes
// the answers are those of single rays, bit for bit.
#pragma once

#include "structures/bvh/bvh_packet_nodes.h"
#include "traversal/box_rays.h"
#include "traversal/packet_interval.h"
#include "traversal/leaves.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Rays of a packet at most.
inline constexpr int kMostPacketRays = BoxRays::kMost;

/// W rays a register. `fast` and `padded` are one class: they differ in what rays bring with them (compile time).
template <class Format, int W, class Leaves, bool AnyHit, class Counting>
class BvhPackets {
 public:
  BvhPackets(const bvh::BvhBase& tree, const KernelRow& row, Counting counting)
      : base_(tree.base()), root_(tree.root()), max_coordinate_(tree.max_coordinate()), padded_(row.box == "padded"), leaves_(row, tree.vertices()),
        form_(*row.tests->form), counting_(counting), stack_(tree.stack_entries()), single_stack_(tree.stack_entries()) {}

  /// Traces `count` rays, 1 to kMostPacketRays; their hits are then in best().
  void trace(const Ray* rays, int count, int threshold) {
    rays_ = rays, threshold_ = threshold;
    if constexpr (Counting::kCounting) ++counting_.counters.packets, lanes_ = unsigned(count);
    chunks_ = (count + W - 1) / W;
    std::uint64_t octants[8] = {};
    prepare(count, octants);
    active_ = ~std::uint64_t{0};
    for (std::uint64_t mask : octants)
      if (mask != 0) traverse(mask);
    if constexpr (!AnyHit) {
      for (std::uint64_t valid = box_.valid; valid; valid &= valid - 1) {
        const int i = __builtin_ctzll(valid);
        auto&& ray = data(i);
        leaves_.finish(ray, best_[i]);
      }
    }
  }
  [[nodiscard]] const NearestHit& best(int i) const { return best_[i]; }
  /// Of all packets so far, how often a ray went on alone.
  [[nodiscard]] std::size_t times_alone() const { return times_alone_; }

 private:
  using F = vf<W>;
  static constexpr int N = Format::kBranching, kLanes = Format::kLanes;
  using Children = vf<kLanes>;

  struct Entry {
    bvh::NodeReference reference;
    float t;
    std::uint64_t mask;
  };
  /// From so many rays on the triangles of a leaf are looked at together.
  static constexpr int kWorthLanes = 16;
  /// Bounds of a group of rays by axis: of 1/d, of the origin at the near and at the far planes, and what they are widened by.
  struct Interval {
    float r_low[3], r_high[3], near_origin[3], far_origin[3], pad[3];
    float tnear;
    bool usable, from_end;
    unsigned near[3];  ///< the near planes; the far one of axis a is 4 a + 1 less that
  };

  /// What the intersector keeps for ray i: where rays can stand in lanes it is made of what the packet keeps whenever it is asked for.
  ARBORETUM_INLINE decltype(auto) data(int i) {
    if constexpr (Leaves::kRaysInLanes) {
      return packet_.alone(rays_[i], i);
    } else {
      return (*reinterpret_cast<typename Leaves::RayData*>(data_ + std::size_t(i) * sizeof(typename Leaves::RayData)));
    }
  }

  void prepare(int count, std::uint64_t (&octants)[8]) {
    if constexpr (Leaves::kRaysInLanes) packet_.clear();
    box_.template prepare<W, N>(count, [this](int i) -> const Ray& { return rays_[i]; }, padded_, max_coordinate_, [this](int k) {
      if constexpr (Leaves::kRaysInLanes) packet_.template prepare<W>(box_.rays, k);
    });
    for (int i = 0; i < count; ++i) best_[i] = NearestHit{box_.t[i]};
    for (unsigned octant = 0; octant < 8; ++octant) {
      std::uint64_t mask = box_.valid;
      for (unsigned a = 0; a < 3; ++a) mask &= (octant >> a & 1u) ? box_.negative[a] : ~box_.negative[a];
      octants[octant] = mask;
    }
    if constexpr (!Leaves::kRaysInLanes) {
      for (std::uint64_t rest = box_.valid; rest; rest &= rest - 1) {
        const int i = __builtin_ctzll(rest);
        new (static_cast<void*>(data_ + std::size_t(i) * sizeof(typename Leaves::RayData))) std::remove_const_t<typename Leaves::RayData>(leaves_.prepare(rays_[i]));
      }
    }
  }

  /// The smallest and the largest value of the lanes of `mask`.
  void range(const float* values, std::uint64_t mask, float& low, float& high) const {
    const F infinity(std::numeric_limits<float>::infinity());
    F least = infinity, most = -infinity;
    for (int c = 0; c < chunks_; ++c) {
      const vm<W> in = vm<W>::from_bits(unsigned(mask >> (c * W)) & ((1u << W) - 1u));
      const F v = F::load(values + c * W);
      least = min_x86(least, select(in, v, infinity)), most = max_x86(most, select(in, v, -infinity));
    }
    low = reduce_min(least), high = -reduce_min(-most);
  }

  /// Bounds along one axis.
  struct Bounds {
    float low, high;
    [[nodiscard]] float largest() const { return -low > high ? -low : high; }
  };

  Interval interval_of(std::uint64_t mask) {
    Interval v;
    v.usable = (mask & box_.overflown) == 0;
    Bounds r[3], o[3], d[3];
    float unused;
    range(box_.first, mask, v.tnear, unused);
    for (int a = 0; a < 3; ++a) {
      range(box_.r[a], mask, r[a].low, r[a].high), range(box_.rays.origin[a], mask, o[a].low, o[a].high);
      range(box_.rays.direction[a], mask, d[a].low, d[a].high);
    }
    float scale[3];
    for (int a = 0; a < 3; ++a) scale[a] = 0x1p-20f * (max_coordinate_ + o[a].largest());
    spread_.reach = 0.0f;
    v.from_end = false;
    if constexpr (AnyHit) {
      if (v.usable) take_common_end(mask, v, o, scale);
    }
    for (int a = 0; a < 3; ++a) {
      const bool negative = __builtin_signbit(r[a].low) != 0;
      v.r_low[a] = r[a].low, v.r_high[a] = r[a].high;
      v.near_origin[a] = negative ? o[a].low : o[a].high, v.far_origin[a] = negative ? o[a].high : o[a].low;
      v.pad[a] = scale[a] * (negative ? -r[a].low : r[a].high) + 0x1p-99f;
      v.near[a] = unsigned(2 * a + negative);
      v.usable &= v.pad[a] < std::numeric_limits<float>::infinity();
      if constexpr (Leaves::kRaysInLanes) spread_.set_axis(a, o[a].low, o[a].high, d[a].low, d[a].high);
    }
    return v;
  }

  /// The product and the sum of o + tfar d round by less than 2^-22 (|o| + |end|) together.
  static float rounding(const Bounds& o, const Bounds& end) { return 0x1p-21f * (o.largest() + end.largest()); }

  /// Rays towards a light have no common origin, but their ends o + tfar d lie close together. Then the bounds of the ends take the place of the origins', and
  /// distances count from a ray's end, s = t - tfar: it meets a plane b at s = (b - end) r.
  void take_common_end(std::uint64_t mask, Interval& v, Bounds (&o)[3], float (&scale)[3]) {
    Bounds t, end[3];
    range(box_.t, mask, t.low, t.high);
    if (!(t.high < std::numeric_limits<float>::infinity())) return;
    float origins = 0.0f, ends = 0.0f, largest = 0.0f;
    for (int a = 0; a < 3; ++a) {
      alignas(64) float at[kMostPacketRays];
      for (int k = 0; k < chunks_ * W; k += W) (F::load(box_.rays.origin[a] + k) + F::load(box_.t + k) * F::load(box_.rays.direction[a] + k)).store(at + k);
      range(at, mask, end[a].low, end[a].high);
      const float most = o[a].largest() > end[a].largest() ? o[a].largest() : end[a].largest();
      largest = most > largest ? most : largest;
      origins += o[a].high - o[a].low, ends += end[a].high - end[a].low + 2.0f * rounding(o[a], end[a]);
    }
    if (!(ends < 0.25f * origins)) return;
    v.from_end = true;
    // What is computed from `end` is off like what is computed from `o` above. Where the direction is as good as 0 along an axis, r is not its reciprocal but 2^60 / |d|max, and s is off by
    // up to tfar <= 2 largest / |d|max: the width is of the largest coordinate of any axis, 2^-19 of which times that r is beyond it.
    for (int a = 0; a < 3; ++a) {
      const float wide = rounding(o[a], end[a]);
      const float up = end[a].high - o[a].low, down = o[a].high - end[a].low;
      spread_.reach += up > down ? up : down;
      o[a] = {end[a].low - wide, end[a].high + wide};
      scale[a] = 0x1p-19f * (max_coordinate_ + largest);
    }
    v.tnear = v.tnear - t.high * (1.0f + 0x1p-20f);
  }

  /// The children that some ray of the packet may meet, and where it enters them at the earliest.
  ARBORETUM_INLINE unsigned children_met(const Interval& v, const std::byte* node, float tfar, Children& entry) const {
    Children near(v.tnear), far(tfar);
    for (int a = 0; a < 3; ++a) {
      const Children low(v.r_low[a]), high(v.r_high[a]), pad(v.pad[a]);
      const Children n = Format::planes(node, v.near[a]) - Children(v.near_origin[a]);
      const Children f = Format::planes(node, unsigned(4 * a + 1) - v.near[a]) - Children(v.far_origin[a]);
      near = max_x86(min_x86(n * low, n * high) - pad, near);
      far = min_x86(max_x86(f * low, f * high) + pad, far);
    }
    entry = near;
    const unsigned bits = (near <= far).bits();
    return N == kLanes ? bits : bits & ((1u << N) - 1u);
  }

  /// Those of `mask` that meet child i.
  ARBORETUM_INLINE std::uint64_t rays_met(const unsigned (&near)[3], const std::byte* node, int i, std::uint64_t mask) const {
    std::uint64_t met = 0;
    for (int c = 0; c < chunks_; ++c) {
      const unsigned in = unsigned(mask >> (c * W)) & ((1u << W) - 1u);
      if (in == 0) continue;
      const int k = c * W;
      const F rx = F::load(box_.r[0] + k), ry = F::load(box_.r[1] + k), rz = F::load(box_.r[2] + k);
      const auto at = [&](unsigned plane, F r, const float* c) { return Format::template distance<F>(node, plane, i, r, F::load(c + k)); };
      const F enter = max_x86(max_x86(at(near[0], rx, box_.near[0]), at(near[1], ry, box_.near[1])), max_x86(at(near[2], rz, box_.near[2]), F::load(box_.first + k)));
      const F leave = min_x86(min_x86(at(1 - near[0], rx, box_.far[0]), at(5 - near[1], ry, box_.far[1])), min_x86(at(9 - near[2], rz, box_.far[2]), F::load(box_.t + k)));
      met |= std::uint64_t((enter <= leave).bits() & in) << k;
    }
    return met;
  }

  [[nodiscard]] float farthest(std::uint64_t mask) const {
    float low, high;
    range(box_.t, mask, low, high);
    return high;
  }

  void traverse(std::uint64_t group) {
    const Interval interval = interval_of(group);
    float tfar = interval.from_end ? 0.0f : farthest(group);
    Entry* const stack = stack_.data();
    Entry* top = stack;
    typename Counting::Depths depths{typename Counting::Depth{}};
    Entry e{root_, interval.tnear, group};
    for (;;) {
      while (!bvh::is_leaf(e.reference)) {
        if (__builtin_popcountll(e.mask) <= threshold_) {
          times_alone_ += unsigned(__builtin_popcountll(e.mask));
          if constexpr (Counting::kCounting) ++counting_.counters.switches, counting_.counters.rays_alone += unsigned(__builtin_popcountll(e.mask));
          for (std::uint64_t rest = e.mask; rest; rest &= rest - 1) alone(__builtin_ctzll(rest), e.reference, depths.current());
          if constexpr (!AnyHit) tfar = farthest(group);
          goto pop;
        }
        const std::byte* node = base_ + bvh::offset_of(e.reference);
        Children entry;
        unsigned hit;
        if (__builtin_expect(interval.usable, 1)) {
          hit = children_met(interval, node, tfar, entry);
        } else {
          entry = Children(interval.tnear);
          hit = (1u << Format::boxes(node)) - 1u;
        }
        alignas(64) float t[kLanes];
        entry.store(t);
        Entry* const bottom = top;
        [[maybe_unused]] MetChildren met;
        for (; hit; hit &= hit - 1) {
          const int i = __builtin_ctz(hit);
          const std::uint64_t mask = rays_met(interval.near, node, i, e.mask);
          if (mask == 0) continue;
          met.add(mask);
          const bvh::NodeReference child = Format::child(node, i);
          const auto* target = reinterpret_cast<const char*>(base_ + bvh::offset_of(child));
          for (int line = 0; line < kPrefetchLines; ++line) _mm_prefetch(target + 64 * line, _MM_HINT_T0);
          Entry* p = top++;
          if constexpr (!AnyHit) {
            for (; p != bottom && p[-1].t < t[i]; --p) *p = p[-1];
          }
          *p = {child, t[i], mask};
        }
        if constexpr (Counting::kCounting) count(node, e.mask, met, depths.current());
        if (top == bottom) goto pop;
        depths.push(bottom - stack, top - stack);
        e = *--top;
        depths.pop(top - stack);
      }
      leaf(e);
      if constexpr (!AnyHit) tfar = farthest(group);
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
  static ARBORETUM_INLINE Vec3f of(const Axes& axes, int i) { return {axes[0][i], axes[1][i], axes[2][i]}; }

  void alone(int i, bvh::NodeReference reference, typename Counting::Depth depth) {
    auto&& ray = data(i);
    const auto below = [&](auto padded) {
      const BoxRay<N, decltype(padded)::value> box(of(box_.r, i), of(box_.near, i), of(box_.far, i));
      return trace_below<Format, Leaves, decltype(padded)::value, AnyHit>(base_, reference, box, box_.first[i], rays_[i], leaves_, ray, best_[i], single_stack_.data(), form_, counting_, depth);
    };
    const bool hit = padded_ ? below(std::true_type{}) : below(std::false_type{});
    if constexpr (AnyHit) {
      if (hit) occluded(i);
    }
    box_.t[i] = best_[i].t;
  }
  void occluded(int i) {
    best_[i].primitive = 0;
    active_ &= ~(std::uint64_t{1} << i);
  }

  void leaf(const Entry& e) {
    const std::byte* const blocks = base_ + bvh::offset_of(e.reference);
    const unsigned count = bvh::block_count(e.reference);
    if constexpr (Leaves::kRaysInLanes) {
      if (__builtin_popcountll(e.mask) >= kWorthLanes) {
        const auto* block = reinterpret_cast<const typename Leaves::Block*>(blocks);
        for (const auto* const end = block + count; block != end; ++block) test_block(*block, e.mask);
        return;
      }
    }
    test_one_by_one(blocks, count, e.mask);
  }

  void test_one_by_one(const std::byte* blocks, unsigned count, std::uint64_t mask) {
    for (; mask; mask &= mask - 1) {
      const int i = __builtin_ctzll(mask);
      if constexpr (Counting::kCounting) counting_.leaf(form_, blocks, count);
      auto&& ray = data(i);
      if constexpr (AnyHit) {
        if (leaves_.any_hit(ray, blocks, count, rays_[i].tnear, rays_[i].tfar)) occluded(i);
      } else {
        if (leaves_.closest_hit(ray, blocks, count, rays_[i].tnear, best_[i])) box_.t[i] = best_[i].t;
      }
    }
  }

  /// One block against the rays of `mask`: its triangles in lanes for each ray, or rays in lanes for each triangle that is left by the packet's
  /// interval, whichever is less work.
  template <class Block>
  void test_block(const Block& block, std::uint64_t mask) {
    const auto* const bytes = reinterpret_cast<const std::byte*>(&block);
    if constexpr (AnyHit) mask &= active_;
    unsigned triangles = interval_triangles(spread_, block);
    if (triangles == 0) return;
    int chunks = 0;
    for (int c = 0; c < chunks_; ++c) chunks += (mask >> (c * W) & ((1u << W) - 1u)) != 0;
    if (__builtin_popcount(triangles) * chunks * W >= __builtin_popcountll(mask) * std::max(W, Block::kWidth))
      return test_one_by_one(bytes, 1, mask);
    std::uint64_t again = 0;
    for (; triangles; triangles &= triangles - 1) {
      const int i = __builtin_ctz(triangles);
      for (int g = 0; g < Packet::kGroups; ++g) {
        const std::uint64_t group = mask & packet_.group(g);
        if (group != 0) test_triangle(block, i, g, group, again);
      }
      if constexpr (AnyHit) mask &= active_;
    }
    if (__builtin_expect(again != 0, 0)) test_one_by_one(bytes, 1, again);
  }

  template <class Block>
  ARBORETUM_INLINE void test_triangle(const Block& block, int triangle, int group, std::uint64_t mask, std::uint64_t& again) {
    const auto id = std::int32_t(block.id[triangle]);
    for (int c = 0; c < chunks_; ++c) {
      const int k = c * W;
      const unsigned in = unsigned(mask >> k) & ((1u << W) - 1u);
      if (in == 0) continue;
      TriangleHits<W> hits;
      vm<W> redo;
      const vm<W> inside = Leaves::Intersector::template intersect_rays<W>(box_.rays, packet_, group, k, block, triangle, hits, redo);
      again |= std::uint64_t(redo.bits() & in) << k;
      if ((inside.bits() & in) == 0) continue;
      unsigned hit = in & (inside & (hits.t <= F::load(box_.t + k)) & (hits.t >= F::load(box_.rays.tnear + k))).bits();
      if (hit == 0) continue;
      alignas(64) float t[W], u[W], v[W], denominator[W];
      hits.t.store(t), hits.u_numerator.store(u), hits.v_numerator.store(v), hits.denominator.store(denominator);
      for (; hit; hit &= hit - 1) {
        const int lane = __builtin_ctz(hit), i = k + lane;
        if constexpr (AnyHit) {
          occluded(i);
        } else {
          NearestHit& best = best_[i];
          if (t[lane] < best.t || id < best.primitive) best = {t[lane], u[lane] / denominator[lane], v[lane] / denominator[lane], id}, box_.t[i] = t[lane];
        }
      }
    }
  }

  /// How many children of a node each ray meets.
  struct WithMetChildren {
    std::uint8_t of_ray[kMostPacketRays] = {};
    void add(std::uint64_t mask) {
      for (; mask; mask &= mask - 1) ++of_ray[__builtin_ctzll(mask)];
    }
  };
  struct NoMetChildren {
    ARBORETUM_INLINE void add(std::uint64_t) const {}
  };
  using MetChildren = std::conditional_t<Counting::kCounting, WithMetChildren, NoMetChildren>;

  /// A node visit of a packet counts as one of each of its rays.
  void count(const std::byte* node, std::uint64_t mask, const MetChildren& met, typename Counting::Depth depth) const {
    const unsigned boxes = Format::boxes(node);
    counting_.at_depth(depth, lanes_, unsigned(__builtin_popcountll(mask)));
    for (; mask; mask &= mask - 1) counting_.node(boxes, kLanes, met.of_ray[__builtin_ctzll(mask)]);
  }

  const std::byte* base_;
  const bvh::NodeReference root_;
  const float max_coordinate_;
  const bool padded_;
  Leaves leaves_;
  const LeafForm& form_;
  Counting counting_;
  const Ray* rays_ = nullptr;
  int threshold_ = 0, chunks_ = 0;
  std::uint64_t active_ = 0;
  std::size_t times_alone_ = 0;
  unsigned lanes_ = 0;  ///< rays of the packet, where it is counted
  BoxRays box_;
  NearestHit best_[kMostPacketRays];
  alignas(64) std::byte data_[Leaves::kRaysInLanes ? 1 : kMostPacketRays * sizeof(typename Leaves::RayData)];
  struct NoPacket {};
  template <class L>
  struct PacketOf {
    using type = typename L::Intersector::PacketData;
  };
  using Packet = typename std::conditional_t<Leaves::kRaysInLanes, PacketOf<Leaves>, std::type_identity<NoPacket>>::type;
  Packet packet_;
  PacketInterval spread_;
  BatchStack<Entry, 512> stack_;
  TraversalStack single_stack_;
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
