// Up to 64 rays as structures of arrays with what they have met, and how those of a mask meet a leaf: one ray after the
// other, or, where the intersector can, the leaf's triangles against many rays in lanes, those first left out that no
// ray of the packet can hit (traversal/packet_interval.h). Of the same triangles each ray gets the bits that it would
// get alone.
#pragma once

#include "traversal/lane_rays.h"
#include "traversal/leaves.h"
#include "traversal/packet_interval.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// W rays a register. `Rays`: LaneRays, or what a structure makes of them.
template <int W, class Leaves, bool AnyHit, class Counting, class Rays>
class PacketLeaves {
 public:
  static constexpr int kMost = LaneRays::kMost;
  using Mask = std::uint64_t;

  PacketLeaves(const KernelRow& row, const Leaves& leaves, Counting counting)
      : leaves_(leaves), form_(*row.tests->form), counting_(counting) {}

  [[nodiscard]] const NearestHit& best(int i) const { return best_[i]; }
  /// Of all packets so far, how often a ray went on alone.
  [[nodiscard]] std::size_t times_alone() const { return times_alone_; }

 protected:
  using F = vf<W>;
  static constexpr unsigned kAll = (1u << W) - 1u;

  /// Traces `rays`, 1 to kMost; their hits are then in best(). `prepare(count, ray_at, each)` hands these to the
  /// prepare() of lanes_; `traverse(mask, octant)` is called for the valid rays of each octant that has some, unless
  /// `together(octants)`, of how many octants they are, has traced them all and returns true. Where no more than
  /// `threshold` rays are in a node they may go on alone.
  template <class Prepare, class Traverse, class Together>
  ARBORETUM_INLINE void trace(const RayBatch& rays, int threshold, const Prepare& prepare, const Traverse& traverse,
                              const Together& together) {
    threshold_ = threshold;
    if constexpr (Counting::kCounting) ++counting_.counters.packets;
    load(rays, prepare);
    Mask masks[8];
    unsigned octants = 0, octant_of[8];
    for (unsigned octant = 0; octant < 8; ++octant) {
      Mask mask = lanes_.valid;
      for (unsigned a = 0; a < 3; ++a) mask &= (octant >> a & 1u) ? lanes_.negative[a] : ~lanes_.negative[a];
      masks[octants] = mask, octant_of[octants] = octant;
      octants += mask != 0;
    }
    if (!together(octants))
      for (unsigned i = 0; i < octants; ++i) traverse(masks[i], octant_of[i]);
    finish();
  }
  template <class Prepare, class Traverse>
  ARBORETUM_INLINE void trace(const RayBatch& rays, int threshold, const Prepare& prepare, const Traverse& traverse) {
    trace(rays, threshold, prepare, traverse, [](unsigned) { return false; });
  }

  /// Where lanes are counted: those of a register of the timed kernel, which the counting one may have more of.
  void set_width(unsigned width) requires Counting::kCounting { width_ = width; }

  /// Too few rays for the packet to go on with.
  ARBORETUM_INLINE bool few(Mask mask) const { return __builtin_popcountll(mask) <= threshold_; }

  /// The rays of `mask` leave the packet: search(i, data) is ray i's search of what is left, as single rays' is, and
  /// returns whether it is occluded.
  template <class Search>
  ARBORETUM_INLINE void go_on_alone(Mask mask, const Search& search) {
    const auto count = unsigned(__builtin_popcountll(mask));
    times_alone_ += count;
    if constexpr (Counting::kCounting) ++counting_.counters.switches, counting_.counters.rays_alone += count;
    for (; mask; mask &= mask - 1) {
      const int i = __builtin_ctzll(mask);
      auto&& ray = data(i);
      const bool hit = search(i, ray);
      if constexpr (AnyHit) {
        if (hit) occluded(i);
      } else {
        back_from_alone(i);
      }
    }
  }

 private:
  /// None of the rays has met anything, but where the leaves know better.
  template <class Prepare>
  ARBORETUM_INLINE void load(const RayBatch& rays, const Prepare& prepare) {
    const int count = int(rays.size());
    rays_ = rays.rays.data(), chunks_ = (count + W - 1) / W, active_ = ~Mask{0}, prepared_ = 0, in_lanes_ = 0;
    if constexpr (Leaves::kRaysInLanes) packet_.clear();
    prepare(
        count, [this](int i) -> const Ray& { return rays_[i]; }, [this](int k) { prepare_lanes(k); });
    const NearestHit none{0.0f};
    const auto nothing = vf<4>::load(&none);  // in one store, not in three
    for (int i = 0; i < count; ++i) {
      if constexpr (requires { leaves_.best_so_far(i); }) {
        best_[i] = leaves_.best_so_far(i);
      } else {
        nothing.store(&best_[i]), best_[i].t = lanes_.t[i];
      }
    }
    if constexpr (!Leaves::kRaysInLanes) {
      for (Mask rest = lanes_.valid; rest; rest &= rest - 1) {
        const int i = __builtin_ctzll(rest);
        new (static_cast<void*>(data_ + std::size_t(i) * sizeof(RayData)))
            std::remove_const_t<RayData>(prepare_at(leaves_, rays_[i], rays.time(std::size_t(i))));
      }
    }
  }

  ARBORETUM_INLINE void prepare_lanes([[maybe_unused]] int k) {
    if constexpr (Leaves::kRaysInLanes) packet_.template prepare<W>(lanes_.rays, k);
    if constexpr (kHitsInLanes) hits_.template start<W>(k, F::load(lanes_.t + k));
  }

  void finish() {
    if constexpr (AnyHit) return;
    Mask rays = lanes_.valid;
    if constexpr (kHitsInLanes) {
      // Straight from the lanes to where they are finished.
      static_assert(kFinishesLater<Leaves>);
      typename UnfinishedOf<Leaves, NearestHit>::Type unfinished;
      for (Mask rest = in_lanes_; rest; rest &= rest - 1) {
        const int i = __builtin_ctzll(rest);
        best_[i] = hits_.at(i, lanes_.t[i]);
        unfinished.add(rays_[i], hits_.corners(i)), unfinished.settle(best_[i]);
      }
      unfinished.finish_all();
      rays &= ~in_lanes_;
    }
    finish_hits(
        leaves_, rays, [this](int i) -> const Ray& { return rays_[i]; },
        [this](int i) -> decltype(auto) { return data(i); }, [this](int i) -> NearestHit& { return best_[i]; });
  }

 protected:
  /// Calls each(k, only) for the registers that the rays take; `only(v, other)`: v in lanes of `mask`, else `other`.
  template <class Each>
  ARBORETUM_INLINE void for_each_register(Mask mask, const Each& each) const {
    if ((~mask << (kMost - chunks_ * W)) == 0) {  // all lanes, as in most packets
      for (int k = 0; k < chunks_ * W; k += W) each(k, [](F v, F) { return v; });
    } else {
      for (int c = 0; c < chunks_; ++c) {
        const vm<W> in = vm<W>::from_bits(lanes_of(mask, c));
        each(c * W, [in](F v, F other) { return select(in, v, other); });
      }
    }
  }

  /// The smallest and the largest values that four rows have in the lanes of `mask`, those of row i in lane i;
  /// `values(i, k)`: the W lanes from k on of row i. No value is NaN. What is 0 may be of either sign.
  template <class Values>
  [[nodiscard]] ARBORETUM_INLINE AxisBounds bounds(Mask mask, const Values& values) const {
    const F infinity(std::numeric_limits<float>::infinity());
    F low[4] = {infinity, infinity, infinity, infinity}, high[4] = {-infinity, -infinity, -infinity, -infinity};
    for_each_register(mask, [&](int k, const auto& only) {
      for (int i = 0; i < 4; ++i) {
        const F v = values(i, k);
        low[i] = min_x86(low[i], only(v, infinity)), high[i] = max_x86(high[i], only(v, -infinity));
      }
    });
    const auto reduce = [](const F(&of)[4], auto op) {
      vf<4> row[4] = {fold_to_four(of[0], op), fold_to_four(of[1], op), fold_to_four(of[2], op),
                      fold_to_four(of[3], op)};
      transpose(row);
      return op(op(row[0], row[1]), op(row[2], row[3]));
    };
    return {reduce(low, [](auto a, auto b) { return min_x86(a, b); }),
            reduce(high, [](auto a, auto b) { return max_x86(a, b); })};
  }
  /// The same for three rows, by axis, and a fourth one.
  [[nodiscard]] ARBORETUM_INLINE AxisBounds bounds(Mask mask, const float (&rows)[3][kMost],
                                                   const float* fourth) const {
    const float* const row[4] = {rows[0], rows[1], rows[2], fourth};
    return bounds(mask, [&](int i, int k) { return F::load(row[i] + k); });
  }

  /// The distances beyond which nothing counts for rays of a mask: the smallest, and the largest.
  struct Span {
    float low, high;
  };
  [[nodiscard]] ARBORETUM_INLINE Span span_of_t(Mask mask) const {
    const F infinity(std::numeric_limits<float>::infinity());
    F low = infinity, high = -infinity;
    for_each_register(mask, [&](int k, const auto& only) {
      const F t = F::load(lanes_.t + k);
      low = min_x86(low, only(t, infinity)), high = max_x86(high, only(t, -infinity));
    });
    return {reduce_min(low), reduce_max(high)};
  }

  /// Before leaves are met by rays of `group`: the bounds of their origins, or of points on their lines that are no
  /// farther from those than `spread_.reach`.
  ARBORETUM_INLINE void set_spread([[maybe_unused]] const AxisBounds& origins, [[maybe_unused]] Mask group) {
    if constexpr (Leaves::kRaysInLanes)
      spread_.set(origins, bounds(group, lanes_.rays.direction, lanes_.rays.direction[0]));
  }

  static ARBORETUM_INLINE unsigned lanes_of(Mask mask, int chunk) { return unsigned(mask >> (chunk * W)) & kAll; }

  /// What the intersector keeps for ray i, which goes on alone: where rays can stand in lanes it is made of what the
  /// packet keeps, the first time or whenever it is asked for. best_[i] is right only after it: what the ray has met in
  /// lanes comes here with it.
  ARBORETUM_INLINE decltype(auto) data(int i) {
    if constexpr (kHitsInLanes) {
      if (in_lanes_ >> i & 1u) fetch(i);
    }
    if constexpr (kMadeWhenNeeded) {
      return packet_.alone(rays_[i], i);
    } else {
      return (prepared_data(i));
    }
  }
  ARBORETUM_INLINE typename Leaves::RayData& prepared_data(int i) {
    if constexpr (Leaves::kRaysInLanes) {
      if ((prepared_ >> i & 1u) == 0) {
        prepared_ |= Mask{1} << i;
        new (static_cast<void*>(data_ + std::size_t(i) * sizeof(RayData))) RayData(packet_.alone(rays_[i], i));
      }
    }
    return *reinterpret_cast<RayData*>(data_ + std::size_t(i) * sizeof(RayData));
  }

  void occluded(int i) { all_occluded(Mask{1} << i); }
  ARBORETUM_INLINE void all_occluded(Mask rays) {
    active_ &= ~rays;
    for (; rays; rays &= rays - 1) best_[__builtin_ctzll(rays)].primitive = 0;
  }

  /// What ray i met while it was alone is known in lanes, too.
  ARBORETUM_INLINE void back_from_alone(int i) {
    lanes_.t[i] = best_[i].t;
    if constexpr (kHitsInLanes) hits_.take_back(i, prepared_data(i));
  }
  /// What ray i has met in lanes comes to where it is looked for when the ray is alone.
  ARBORETUM_INLINE void fetch(int i) {
    in_lanes_ &= ~(Mask{1} << i);
    best_[i] = hits_.at(i, lanes_.t[i]), hits_.bring(i, prepared_data(i));
  }

  /// Before leaves are met by rays of `group`: whether their origins are the same, bit for bit. `perhaps`: they are but
  /// for the signs of zeros.
  void look_for_common_origin([[maybe_unused]] Mask group, [[maybe_unused]] bool perhaps) {
    if constexpr (kSeesFromOrigin) {
      common_origin_ = false;
      if (!perhaps) return;
      origin_of_ = __builtin_ctzll(group);
      Mask others = 0;
      for (int c = 0; c < chunks_; ++c) {
        vm<W> same(true);
        for (const auto& origin : lanes_.rays.origin)
          same = same & (vi<W>::load(origin + c * W) == vi<W>(__builtin_bit_cast(std::int32_t, origin[origin_of_])));
        others |= ~same.bits() & lanes_of(group, c);
      }
      common_origin_ = others == 0;
    }
  }

  /// The rays of `mask` visit a node together, each tested against `boxes` of its children. Returns the lanes that
  /// these tests take, those of registers without a ray left out, and of them those with one.
  std::pair<unsigned, unsigned> count_node(Mask mask, unsigned boxes) const requires Counting::kCounting {
    const auto rays = unsigned(__builtin_popcountll(mask));
    const unsigned lanes = lanes_with(mask);
    counting_.share_node(rays), counting_.box_tests(boxes * lanes, boxes * rays);
    return {boxes * lanes, boxes * rays};
  }
  /// The lanes of those registers that hold rays of `mask`.
  [[nodiscard]] unsigned lanes_with(Mask mask) const requires Counting::kCounting {
    unsigned lanes = 0;
    for (unsigned k = 0; k < unsigned(kMost); k += width_)
      if ((mask >> k & ((Mask{1} << width_) - 1)) != 0) lanes += width_;
    return lanes;
  }

  void leaf(const std::byte* blocks, unsigned count, Mask mask) {
    if constexpr (Counting::kCounting) counting_.share_leaf(unsigned(__builtin_popcountll(mask)));
    if constexpr (Leaves::kRaysInLanes) {
      if (__builtin_popcountll(mask) >= kWorthLanes) {
        const auto* block = reinterpret_cast<const typename Leaves::Block*>(blocks);
        for (const auto* const end = block + count; block != end; ++block) test_block(*block, mask);
        return;
      }
    }
    one_by_one(blocks, count, mask);
  }

 private:
  using RayData = typename Leaves::RayData;
  /// RayData is made of what the packet keeps whenever it is asked for: nothing that a search finds is kept in it.
  static constexpr bool kMadeWhenNeeded = [] {
    if constexpr (Leaves::kRaysInLanes) {
      return !kFinishes<typename Leaves::Intersector>;
    } else {
      return false;
    }
  }();
  /// What rays in lanes meet is kept in lanes.
  static constexpr bool kHitsInLanes = [] {
    if constexpr (Leaves::kRaysInLanes && !AnyHit) {
      return requires { typename Leaves::Intersector::template PacketHits<typename Leaves::Block>; };
    } else {
      return false;
    }
  }();
  /// From so many rays on the triangles of a leaf are looked at together.
  static constexpr int kWorthLanes = 16;
  /// The intersector has a form of a block for rays of one origin.
  static constexpr bool kSeesFromOrigin = [] {
    if constexpr (Leaves::kRaysInLanes && !AnyHit) {
      return requires { typename Leaves::Intersector::template FromOrigin<Leaves::Block::kWidth>; };
    } else {
      return false;
    }
  }();

  void one_by_one(const std::byte* blocks, unsigned count, Mask mask) {
    const auto hit = [this](int i) {
      if constexpr (AnyHit) {
        occluded(i);
      } else {
        back_from_alone(i);
      }
    };
    test_leaf<AnyHit>(
        leaves_, form_, counting_, blocks, count, mask, [this](int i) -> const Ray& { return rays_[i]; },
        [this](int i) -> decltype(auto) { return data(i); }, [this](int i) -> NearestHit& { return best_[i]; }, hit);
  }

  /// One block against the rays of `mask`, those of its triangles left out that none of them can hit.
  template <class Block>
  void test_block(const Block& block, Mask mask) {
    if constexpr (AnyHit) mask &= active_;
    const unsigned triangles = interval_triangles(spread_, block);
    if (triangles == 0) return;
    if constexpr (kSeesFromOrigin) {
      if (common_origin_) {
        const typename Leaves::Intersector::template FromOrigin<Block::kWidth> seen(block, rays_[origin_of_].origin);
        return test_triangles(seen, triangles, mask, [&](Mask rays) {
          for (; rays; rays &= rays - 1) {
            const int i = __builtin_ctzll(rays);
            auto&& ray = data(i);
            if (closest_hit_block<typename Leaves::Intersector>(ray, seen, rays_[i].tnear, best_[i]))
              back_from_alone(i);
          }
        });
      }
    }
    test_triangles(block, triangles, mask,
                   [&](Mask rays) { one_by_one(reinterpret_cast<const std::byte*>(&block), 1, rays); });
  }

  /// The triangles in lanes for each ray, or rays in lanes for each triangle, whichever is less work.
  template <class Block, class OneByOne>
  ARBORETUM_INLINE void test_triangles(const Block& block, unsigned triangles, Mask mask, const OneByOne& each_alone) {
    int chunks = 0;
    for (int c = 0; c < chunks_; ++c) chunks += lanes_of(mask, c) != 0;
    if (__builtin_popcount(triangles) * chunks * W >= __builtin_popcountll(mask) * std::max(W, Block::kWidth))
      return each_alone(mask);
    Mask again = 0;
    for (; triangles; triangles &= triangles - 1) {
      const int i = __builtin_ctz(triangles);
      for (int g = 0; g < Packet::kGroups; ++g) {
        const Mask group = mask & packet_.group(g);
        if (group != 0) test_triangle(block, i, g, group, again);
      }
      if constexpr (AnyHit) mask &= active_;
    }
    if (__builtin_expect(again != 0, 0)) each_alone(again);
  }

  /// Against a triangle the rays of `mask`, which are of one group; those to be tested alone come to `again`.
  template <class Block>
  ARBORETUM_INLINE void test_triangle(const Block& block, int triangle, int group, Mask mask, Mask& again) {
    for (int c = 0; c < chunks_; ++c) {
      if (const unsigned in = lanes_of(mask, c)) {
        if constexpr (requires { typename Leaves::Intersector::template FilteredRays<W>; }) {
          filter(block, triangle, group, c * W, in, again);
        } else {
          intersect(block, triangle, group, c * W, in, again);
        }
      }
    }
  }

  /// Lanes `in` of the W rays from k on, with an intersector that decides all but `again` itself.
  template <class Block>
  ARBORETUM_INLINE void intersect(const Block& block, int triangle, int group, int k, unsigned in, Mask& again) {
    TriangleHits<W> hits;
    unsigned redo;
    const unsigned inside = Leaves::Intersector::template intersect_rays<W>(lanes_.rays, packet_, group, k, in, block,
                                                                            triangle, hits, redo);
    again |= Mask(redo) << k;
    if (inside == 0) return;
    unsigned hit = inside & ((hits.t <= F::load(lanes_.t + k)) & (hits.t >= F::load(lanes_.rays.tnear + k))).bits();
    if (hit == 0) return;
    if constexpr (AnyHit) return all_occluded(Mask(hit) << k);
    // One by one: as a rule few rays meet one triangle, and to take hits in lanes costs more than that.
    const auto id = std::int32_t(block.id[triangle]);
    alignas(64) float t[W], u[W], v[W], denominator[W];
    hits.t.store(t), hits.u_numerator.store(u), hits.v_numerator.store(v), hits.denominator.store(denominator);
    for (; hit; hit &= hit - 1) {
      const int lane = __builtin_ctz(hit), i = k + lane;
      NearestHit& best = best_[i];
      if (t[lane] < best.t || id < best.primitive)
        best = {t[lane], u[lane] / denominator[lane], v[lane] / denominator[lane], id}, lanes_.t[i] = t[lane];
    }
  }

  /// The same with one that knows an interval about t, and what its search has found so far (exact.h).
  template <class Block>
  ARBORETUM_INLINE void filter(const Block& block, int triangle, int group, int k, unsigned in, Mask& again) {
    typename Leaves::Intersector::template FilteredRays<W> rays;
    Leaves::Intersector::template filter_rays<AnyHit, W>(lanes_.rays, packet_, group, k, in, block, triangle,
                                                         F::load(lanes_.t + k), rays);
    if constexpr (AnyHit) {
      all_occluded(Mask(rays.hit) << k);
    } else if (rays.hit != 0) {
      const unsigned taken = hits_.template take<W>(k, rays, block, triangle, lanes_.t);
      in_lanes_ |= Mask(taken) << k, rays.again |= rays.hit & ~taken;
    }
    again |= Mask(rays.again) << k;
  }

 protected:
  Leaves leaves_;
  const LeafForm& form_;
  Counting counting_;
  const Ray* rays_ = nullptr;
  int chunks_ = 0;      ///< registers that the rays take
  unsigned width_ = 0;  ///< set_width()
  Mask active_ = 0;     ///< rays whose search is not over (any hit)
  Rays lanes_;
  NearestHit best_[kMost];

 private:
  struct Nothing {};
  template <class L>
  struct PacketOf {
    using type = typename L::Intersector::PacketData;
  };
  using Packet = typename std::conditional_t<Leaves::kRaysInLanes, PacketOf<Leaves>, std::type_identity<Nothing>>::type;
  template <class L>
  struct HitsOf {
    using type = typename L::Intersector::template PacketHits<typename L::Block>;
  };
  using Hits = typename std::conditional_t<kHitsInLanes, HitsOf<Leaves>, std::type_identity<Nothing>>::type;
  alignas(64) std::byte data_[kMadeWhenNeeded ? 1 : kMost * sizeof(RayData)];
  Mask prepared_ = 0;
  Packet packet_;
  Mask in_lanes_ = 0;  ///< rays whose nearest hit is in hits_, not in best_ (data())
  Hits hits_;
  bool common_origin_ = false;
  int threshold_ = 0;
  std::size_t times_alone_ = 0;
  int origin_of_ = 0;  ///< a ray that has it

 protected:
  PacketInterval spread_;
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
