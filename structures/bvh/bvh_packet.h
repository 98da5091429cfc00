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
// Without FMA r may be infinite; such a packet has no interval test.
//
// Every ray visits at least the leaves that it would visit alone, up to those that begin beyond its nearest hit. So with padded boxes
// the answers are those of single rays, bit for bit.
#pragma once

#include "structures/bvh/bvh_packet_nodes.h"
#include "traversal/packet_interval.h"
#include "traversal/leaves.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Rays of a packet at most.
inline constexpr int kMostPacketRays = PacketRays::kMost;

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
      for (std::uint64_t valid = valid_; valid; valid &= valid - 1) {
        const int i = __builtin_ctzll(valid);
        auto&& ray = data(i);
        leaves_.finish(ray, best_[i]);
      }
    }
  }
  [[nodiscard]] const NearestHit& best(int i) const { return best_[i]; }

 private:
  using F = vf<W>;
  static constexpr int N = Format::kBranching, kLanes = Format::kLanes;
  using Children = vf<kLanes>;
  using Box = BoxRay<N, true>;

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
    bool usable;
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

  /// The rays as structures of arrays and their constants of BoxRay, W at a time: the same operations, so the same bits.
  void prepare(int count, std::uint64_t (&octants)[8]) {
    for (int i = 0; i < count; ++i) {
      const Ray& ray = rays_[i];
      soa_.origin[0][i] = ray.origin.x, soa_.origin[1][i] = ray.origin.y, soa_.origin[2][i] = ray.origin.z;
      soa_.direction[0][i] = ray.direction.x, soa_.direction[1][i] = ray.direction.y, soa_.direction[2][i] = ray.direction.z;
      soa_.tnear[i] = ray.tnear, t_[i] = ray.tfar;
      best_[i] = NearestHit{ray.tfar};
    }
    for (int i = count; i < chunks_ * W; ++i) {
      for (int a = 0; a < 3; ++a) soa_.origin[a][i] = soa_.direction[a][i] = 0.0f;
      soa_.tnear[i] = t_[i] = 0.0f;
    }
    valid_ = overflown_ = 0;
    if constexpr (Leaves::kRaysInLanes) packet_.clear();
    std::uint64_t negative[3] = {};
    for (int c = 0; c < chunks_; ++c) {
      const int k = c * W;
      const F o[3] = {F::load(soa_.origin[0] + k), F::load(soa_.origin[1] + k), F::load(soa_.origin[2] + k)};
      const F d[3] = {F::load(soa_.direction[0] + k), F::load(soa_.direction[1] + k), F::load(soa_.direction[2] + k)};
      const F largest = max_x86(max_x86(abs(d[0]), abs(d[1])), abs(d[2]));
      const F infinity(std::numeric_limits<float>::infinity()), tnear = F::load(soa_.tnear + k);
      vm<W> valid = (tnear <= F::load(t_ + k)) & (largest > F(0.0f));
      for (int a = 0; a < 3; ++a) valid = valid & (abs(o[a]) < infinity) & (abs(d[a]) < infinity);
      valid_ |= std::uint64_t(valid.bits()) << k;
      max_x86(tnear, F(0.0f)).store(tnear_ + k);
      if constexpr (Leaves::kRaysInLanes) packet_.template prepare<W>(soa_, k);
      vm<W> overflows(false);
      for (int a = 0; a < 3; ++a) {
        F r, f, g;
        if (padded_) {
          Box::template constants<true>(o[a], d[a], largest, F(max_coordinate_), r, f, g);
        } else {
          Box::template constants<false>(o[a], d[a], largest, F(max_coordinate_), r, f, g);
        }
        r.store(r_[a] + k), f.store(near_[a] + k), g.store(far_[a] + k);
        overflows = overflows | Box::overflows(f, g);
        negative[a] |= std::uint64_t((sign_bits(r) < vi<W>(0)).bits()) << k;
      }
      const unsigned overflown = (overflows & valid).bits();
      if (__builtin_expect(overflown != 0, 0)) set_one_by_one(overflown, k);
    }
    for (unsigned octant = 0; octant < 8; ++octant) {
      std::uint64_t mask = valid_;
      for (unsigned a = 0; a < 3; ++a) mask &= (octant >> a & 1u) ? negative[a] : ~negative[a];
      octants[octant] = mask;
    }
    if constexpr (!Leaves::kRaysInLanes) {
      for (std::uint64_t rest = valid_; rest; rest &= rest - 1) {
        const int i = __builtin_ctzll(rest);
        new (static_cast<void*>(data_ + std::size_t(i) * sizeof(typename Leaves::RayData))) std::remove_const_t<typename Leaves::RayData>(leaves_.prepare(rays_[i]));
      }
    }
  }

  /// Rays with constants that overflow, which BoxRay mends. No interval can hold them.
  __attribute__((noinline)) void set_one_by_one(unsigned lanes, int k) {
    overflown_ |= std::uint64_t(lanes) << k;
    const auto set = [&](int i, const auto& box) {
      r_[0][i] = box.r.x, r_[1][i] = box.r.y, r_[2][i] = box.r.z;
      near_[0][i] = box.f.x, near_[1][i] = box.f.y, near_[2][i] = box.f.z;
      far_[0][i] = box.g.x, far_[1][i] = box.g.y, far_[2][i] = box.g.z;
    };
    for (; lanes; lanes &= lanes - 1) {
      const int i = k + __builtin_ctz(lanes);
      if (padded_) {
        set(i, BoxRay<N, true>(rays_[i], max_coordinate_));
      } else {
        set(i, BoxRay<N, false>(rays_[i], max_coordinate_));
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

  Interval interval_of(std::uint64_t mask) {
    Interval v;
    v.usable = (mask & overflown_) == 0;
    float o_low[3], o_high[3], d_low[3], d_high[3], unused;
    range(tnear_, mask, v.tnear, unused);
    for (int a = 0; a < 3; ++a) range(r_[a], mask, v.r_low[a], v.r_high[a]), range(soa_.origin[a], mask, o_low[a], o_high[a]), range(soa_.direction[a], mask, d_low[a], d_high[a]);
    for (int a = 0; a < 3; ++a) {
      const bool negative = __builtin_signbit(v.r_low[a]) != 0;
      const float r = negative ? -v.r_low[a] : v.r_high[a];
      const float o = -o_low[a] > o_high[a] ? -o_low[a] : o_high[a];
      v.near_origin[a] = negative ? o_low[a] : o_high[a], v.far_origin[a] = negative ? o_high[a] : o_low[a];
      v.pad[a] = 0x1p-20f * (max_coordinate_ + o) * r + 0x1p-99f;
      v.near[a] = unsigned(2 * a + negative);
      v.usable &= v.pad[a] < std::numeric_limits<float>::infinity();
      if constexpr (Leaves::kRaysInLanes) spread_.set_axis(a, o_low[a], o_high[a], d_low[a], d_high[a]);
    }
    return v;
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
      const F rx = F::load(r_[0] + k), ry = F::load(r_[1] + k), rz = F::load(r_[2] + k);
      const auto at = [&](unsigned plane, F r, const float* c) { return Format::template distance<F>(node, plane, i, r, F::load(c + k)); };
      const F enter = max_x86(max_x86(at(near[0], rx, near_[0]), at(near[1], ry, near_[1])), max_x86(at(near[2], rz, near_[2]), F::load(tnear_ + k)));
      const F leave = min_x86(min_x86(at(1 - near[0], rx, far_[0]), at(5 - near[1], ry, far_[1])), min_x86(at(9 - near[2], rz, far_[2]), F::load(t_ + k)));
      met |= std::uint64_t((enter <= leave).bits() & in) << k;
    }
    return met;
  }

  [[nodiscard]] float farthest(std::uint64_t mask) const {
    float low, high;
    range(t_, mask, low, high);
    return high;
  }

  void traverse(std::uint64_t group) {
    const Interval interval = interval_of(group);
    float tfar = farthest(group);
    Entry* const stack = stack_.data();
    Entry* top = stack;
    typename Counting::Depths depths{typename Counting::Depth{}};
    Entry e{root_, interval.tnear, group};
    for (;;) {
      while (!bvh::is_leaf(e.reference)) {
        if (__builtin_popcountll(e.mask) <= threshold_) {
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
      const BoxRay<N, decltype(padded)::value> box(of(r_, i), of(near_, i), of(far_, i));
      return trace_below<Format, Leaves, decltype(padded)::value, AnyHit>(base_, reference, box, tnear_[i], rays_[i], leaves_, ray, best_[i], single_stack_.data(), form_, counting_, depth);
    };
    const bool hit = padded_ ? below(std::true_type{}) : below(std::false_type{});
    if constexpr (AnyHit) {
      if (hit) occluded(i);
    }
    t_[i] = best_[i].t;
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
        if (leaves_.closest_hit(ray, blocks, count, rays_[i].tnear, best_[i])) t_[i] = best_[i].t;
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
      const vm<W> inside = Leaves::Intersector::template intersect_rays<W>(soa_, packet_, group, k, block, triangle, hits, redo);
      again |= std::uint64_t(redo.bits() & in) << k;
      if ((inside.bits() & in) == 0) continue;
      unsigned hit = in & (inside & (hits.t <= F::load(t_ + k)) & (hits.t >= F::load(soa_.tnear + k))).bits();
      if (hit == 0) continue;
      alignas(64) float t[W], u[W], v[W], denominator[W];
      hits.t.store(t), hits.u_numerator.store(u), hits.v_numerator.store(v), hits.denominator.store(denominator);
      for (; hit; hit &= hit - 1) {
        const int lane = __builtin_ctz(hit), i = k + lane;
        if constexpr (AnyHit) {
          occluded(i);
        } else {
          NearestHit& best = best_[i];
          if (t[lane] < best.t || id < best.primitive) best = {t[lane], u[lane] / denominator[lane], v[lane] / denominator[lane], id}, t_[i] = t[lane];
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
  std::uint64_t active_ = 0, valid_ = 0, overflown_ = 0;
  unsigned lanes_ = 0;  ///< rays of the packet, where it is counted
  PacketRays soa_;
  alignas(64) float r_[3][kMostPacketRays], near_[3][kMostPacketRays], far_[3][kMostPacketRays], tnear_[kMostPacketRays], t_[kMostPacketRays];
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
