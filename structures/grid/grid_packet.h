// Packets: up to 64 rays go through a grid together, slice by slice along the axis of their directions' largest
// component, after Wald, Ize, Kensler, Knoll and Parker, "Ray Tracing Animated Scenes using Coherent Grid Traversal"
// (SIGGRAPH 2006). There the four corner rays of a frustum bound the cells of a slice; here all rays meet the slice's
// two faces in lanes, which gives the cells of each ray, too: a cell's triangles are tested with the rays that may be
// in it, not with the whole packet. A crowded cell is walked by its rays in the same way. Where no more than
// `threshold` rays go on beyond a slice they do so alone.
//
// Why a ray gets the bits that it gets alone: grid.h proves that the cell in which a ray is at t holds what is met at
// t, if the position is off by less than the pad. Here t at a face is (face - o) * r, off by 3 u |face - o| |r| and
// what the face's rounding (u M) makes, and the position on the other axes is o + t * d, with |d| at most twice that
// along the slices, since rays for which it is more go in another group. With |face - o| <= 17 L and |o| <= M + 16 L
// that is off by
//   2 (u M + 51 u L) + 34 u L + u (M + 50 L) < 4 u M + 190 u L,
// and the cell's index by 2 u L and, for the float corners of inner grids, 2 u M more. A ray's cells in a slice are
// those between its positions on the two faces, widened by the pad, which is 16 u M + 256 u L: so they contain the one
// that it is in. Slices follow each other without a gap in t, the first and last are open. What is tested beyond that
// are triangles, whose answer is the same wherever they are found.
#pragma once

#include "structures/grid/grid_single.h"
#include "structures/leaves/leaf_lists_packet.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Up to 64 rays side by side, each with its reciprocal direction.
struct GridRays : LaneRays {
  alignas(64) float r[3][kMost];
  std::uint64_t beyond;  ///< rays outside the walk's bounds (grid.h)

  /// As LaneRays::prepare().
  template <int W, class RayAt, class Each>
  ARBORETUM_INLINE void prepare(int count, const RayAt& ray_at, const grid::Grid& grid, const Each& each) {
    beyond = 0;
    LaneRays::prepare<W>(count, ray_at, [&](int k) {
      using F = vf<W>;
      const float* const lower = grid.levels()[0].lower;
      F away(0.0f), largest(0.0f);
      for (int a = 0; a < 3; ++a) {
        const F d = F::load(rays.direction[a] + k);
        (F(1.0f) / d).store(r[a] + k);
        away = max_abs(away, F::load(rays.origin[a] + k) - F(lower[a])), largest = max_abs(largest, d);
      }
      beyond |= std::uint64_t((~within_walk_bounds(grid, away, largest)).bits()) << k;
      each(k);
    });
  }
};

/// W rays a register. `fast` and `padded` differ in rays outside the walk's bounds.
template <int W, class Leaves, bool AnyHit, class Counting>
class GridPackets : private ListedPacketLeaves<W, Leaves, AnyHit, Counting, GridRays> {
  using Base = ListedPacketLeaves<W, Leaves, AnyHit, Counting, GridRays>;

 public:
  using Base::best, Base::set_width, Base::times_alone;

  GridPackets(const grid::Grid& grid, const KernelRow& row, Counting counting)
      : Base(row, grid.leaves(), counting), grid_(grid), padded_(row.box == "padded") {}

  /// Traces `rays`, 1 to kMost; their hits are then in best().
  void trace(const RayBatch& rays, int threshold) {
    Base::trace(
        rays, threshold,
        [&](int count, const auto& ray_at, const auto& each) {
          lanes_.template prepare<W>(count, ray_at, grid_, each);
        },
        [](Mask, unsigned) {},
        [&](unsigned) {
          Base::forget_leaves();
          if (const Mask beyond = lanes_.valid & lanes_.beyond) trace_beyond(beyond);
          Mask rest = lanes_.valid & ~lanes_.beyond;
          while (rest != 0) {
            const Mask group = next_group(rest);
            rest &= ~group;
            trace_group(group);
          }
          return true;
        });
  }

 private:
  using typename Base::Mask;
  using F = vf<W>;
  using Base::active_, Base::best_, Base::chunks_, Base::counting_, Base::lanes_, Base::last_leaf_, Base::rays_;

  /// The cells that each ray is in while it is in a slice, by the two axes across: whole numbers, or no cell where the
  /// ray is in none.
  struct RayCells {
    alignas(64) float low[2][Base::kMost], high[2][Base::kMost];
  };
  /// The cells of a slice that some ray is in, and where the rays are.
  struct Slice {
    Mask here = 0;   ///< rays that are in cells of it
    Mask going = 0;  ///< rays that come to it: the others are done
    std::uint32_t low[2], high[2];
  };
  /// Slices of a level as the rays come to them: they enter slice i by face i + entered.
  struct Order {
    std::uint32_t first, last;
  };

  void trace_beyond(Mask rays) {
    Base::go_on_alone(rays, [&](int i, auto& visits) {
      if (padded_) return walk_far(grid_, rays_[i], best_[i], visits);
      return walk_grid<AnyHit>(grid_, rays_[i], {AnyHit ? best_[i].t : rays_[i].tnear}, best_[i], last_leaf_[i],
                               counting_, visits);
    });
  }

  /// Of the rays left, the first one and those that go the same way along the axis of its direction's largest
  /// component, which is then along_.
  Mask next_group(Mask rest) {
    const int i = __builtin_ctzll(rest);
    const Vec3f d = rays_[i].direction;
    const float x = __builtin_fabsf(d.x), y = __builtin_fabsf(d.y), z = __builtin_fabsf(d.z);
    along_ = x >= y && x >= z ? 0 : y >= z ? 1 : 2;
    across_[0] = along_ == 0 ? 1 : 0, across_[1] = along_ == 2 ? 1 : 2;
    const Mask negative = lanes_.negative[along_], same_way = (negative >> i & 1u) ? negative : ~negative;
    descending_ = ((negative >> i & 1u) != 0) != AnyHit;
    Mask group = 0;
    for (int k = 0; k < chunks_ * W; k += W) {
      const auto d_of = [&](int axis) { return F::load(lanes_.rays.direction[axis] + k); };
      const F twice = abs(d_of(along_)) * F(2.0f);
      group |= Mask(((abs(d_of(across_[0])) <= twice) & (abs(d_of(across_[1])) <= twice)).bits()) << k;
    }
    return group & same_way & rest;
  }

  void trace_group(Mask group) {
    const grid::Level& outer = grid_.levels()[0];
    Order order;
    const Mask inside = clip(outer, group, order);
    if (inside == 0) return;
    const AxisBounds origins = Base::bounds(inside, lanes_.rays.origin, lanes_.rays.origin[0]);
    Base::set_spread(origins, inside);
    Base::look_for_common_origin(inside, all(origins.low == origins.high));
    search<0>(outer, inside, order);
  }

  /// The rays of `mask` that meet the level's box (as GridWalk::clip() has it), and from where to where they are in it.
  Mask clip(const grid::Level& level, Mask mask, Order& order) const {
    const F infinity(std::numeric_limits<float>::infinity());
    const float pad = grid_.pad(), least = level.lower[along_];
    Mask inside = 0;
    F lowest = infinity, highest = -infinity;
    for (int c = 0; c < chunks_; ++c) {
      const unsigned in = Base::lanes_of(mask, c);
      if (in == 0) continue;
      const int k = c * W;
      F largest(0.0f);
      for (const auto& d : lanes_.rays.direction) largest = max_abs(largest, F::load(d + k));
      F enter = F::load(lanes_.rays.tnear + k), leave = F::load(lanes_.t + k);
      for (int a = 0; a < 3; ++a) {
        const F o = F::load(lanes_.rays.origin[a] + k), d = F::load(lanes_.rays.direction[a] + k),
                r = F::load(lanes_.r[a] + k);
        const F lower = F(level.lower[a]) - o,
                upper = madd(F(level.last[a]) + F(1.0f), F(level.cell[a]), F(level.lower[a])) - o;
        const vm<W> fixed = abs(d) <= largest * F(0x1p-60f), negative = d.as_int() < vi<W>(0);
        const vm<W> outside = fixed & ((lower > F(0.0f)) | (upper < F(0.0f)));
        const F near = select(negative, upper, lower) * r, far = select(negative, lower, upper) * r;
        enter = max_x86(select(fixed, select(outside, infinity, -infinity), near), enter);
        leave = min_x86(select(fixed, infinity, far), leave);
      }
      const vm<W> meets = (enter <= leave) & vm<W>::from_bits(in);
      inside |= Mask(meets.bits()) << k;
      const F o = F::load(lanes_.rays.origin[along_] + k), d = F::load(lanes_.rays.direction[along_] + k);
      const F from = madd(enter, d, o), to = madd(leave, d, o);
      lowest = min_x86(select(meets, min_x86(from, to), infinity), lowest);
      highest = max_x86(select(meets, max_x86(from, to), -infinity), highest);
    }
    if (inside == 0) return 0;
    const auto slice = [&](float at) {
      return std::uint32_t(std::clamp((at - least) * level.inverse[along_], 0.0f, level.last[along_]));
    };
    const std::uint32_t low = slice(reduce_min(lowest) - pad), high = slice(reduce_max(highest) + pad);
    order = descending_ ? Order{high, low} : Order{low, high};
    return inside;
  }

  /// The rays of `mask` through the slices of a level; `Depth`: 0 the outer one, 1 that of a crowded cell.
  template <int Depth>
  void search(const grid::Level& level, Mask mask, Order order) {
    count_levels(mask);
    for (std::uint32_t at = order.first;; descending_ ? --at : ++at) {
      if constexpr (AnyHit) mask &= active_;
      Slice slice;
      meet<Depth>(level, mask, order, at, slice);
      mask = slice.going;
      if (mask == 0) return;
      if constexpr (Depth == 0) {
        if (Base::few(mask)) return go_on_alone(mask, entered_face(level, at), at == order.first);
      }
      if (slice.here != 0) search_cells<Depth>(level, at, slice);
      if (at == order.last) return;
    }
  }

  [[nodiscard]] float entered_face(const grid::Level& level, std::uint32_t slice) const {
    return grid::face(level, std::size_t(along_), slice + unsigned(descending_));
  }
  [[nodiscard]] float left_face(const grid::Level& level, std::uint32_t slice) const {
    return grid::face(level, std::size_t(along_), slice + unsigned(!descending_));
  }

  /// Where the rays of `mask` are in slice `at`.
  template <int Depth>
  ARBORETUM_INLINE void meet(const grid::Level& level, Mask mask, Order order, std::uint32_t at, Slice& slice) {
    const F entered_face_at(entered_face(level, at)), left_face_at(left_face(level, at));
    const F infinity(std::numeric_limits<float>::infinity()), pad(grid_.pad());
    F low[2] = {infinity, infinity}, high[2] = {-infinity, -infinity};
    const float *const origins = lanes_.rays.origin[along_], *const reciprocals = lanes_.r[along_];
    struct Across {
      const float *origins, *directions;
      F lower, scale, most;
    };
    const auto across = [&](int a) {
      return Across{lanes_.rays.origin[a], lanes_.rays.direction[a], F(level.lower[a]), F(level.inverse[a]),
                    F(level.last[a])};
    };
    const Across both[2] = {across(across_[0]), across(across_[1])};
    for (int c = 0; c < chunks_; ++c) {
      const unsigned in = Base::lanes_of(mask, c);
      if (in == 0) continue;
      const int k = c * W;
      const F o = F::load(origins + k), r = F::load(reciprocals + k), tnear = F::load(lanes_.rays.tnear + k),
              t = F::load(lanes_.t + k);
      const F entered = (entered_face_at - o) * r, left = (left_face_at - o) * r;
      vm<W> going = vm<W>::from_bits(in);
      if (at != order.first) going = going & (AnyHit ? entered >= tnear : entered <= t);
      vm<W> here = going;
      if (at != order.last) here = here & (AnyHit ? left <= t : left >= tnear);
      F first[2], last[2];
      for (int i = 0; i < 2; ++i) {
        const Across& a = both[i];
        const F from = F::load(a.origins + k), d = F::load(a.directions + k);
        const F p = madd(entered, d, from), q = madd(left, d, from);
        const F least_cell = (min_x86(p, q) - pad - a.lower) * a.scale,
                most_cell = (max_x86(p, q) + pad - a.lower) * a.scale;
        here = here & (most_cell >= F(0.0f)) & (least_cell < a.most + F(1.0f));
        const auto whole = [&](F cell) { return to_float(truncate_to_int(min_x86(max_x86(cell, F(0.0f)), a.most))); };
        first[i] = whole(least_cell), last[i] = whole(most_cell);
        first[i].store(cells_[Depth].low[i] + k), last[i].store(cells_[Depth].high[i] + k);
      }
      for (int i = 0; i < 2; ++i)
        low[i] = min_x86(select(here, first[i], infinity), low[i]),
        high[i] = max_x86(select(here, last[i], -infinity), high[i]);
      slice.going |= Mask(going.bits()) << k, slice.here |= Mask(here.bits()) << k;
    }
    if (slice.here == 0) return;
    for (int i = 0; i < 2; ++i)
      slice.low[i] = std::uint32_t(reduce_min(low[i])), slice.high[i] = std::uint32_t(reduce_max(high[i]));
  }

  template <int Depth>
  void search_cells(const grid::Level& level, std::uint32_t at, const Slice& slice) {
    const std::uint32_t row = level.cells_on(0), layer = row * level.cells_on(1);
    const std::uint32_t strides[3] = {1, row, layer};
    const std::uint32_t stride[2] = {strides[across_[0]], strides[across_[1]]};
    const LeafCode* const codes = grid_.codes() + level.first + std::size_t(at) * strides[along_];
    const bool one_cell = slice.low[0] == slice.high[0] && slice.low[1] == slice.high[1];
    const std::uint32_t wide = slice.high[0] - slice.low[0], high = slice.high[1] - slice.low[1];
    for (std::uint32_t v = 0; v <= high; ++v) {
      for (std::uint32_t u = 0; u <= wide; ++u) {
        // Backwards where slices are, so that any hit passes all cells in the reverse order of closest hit.
        const std::uint32_t i = descending_ ? slice.high[0] - u : slice.low[0] + u,
                            j = descending_ ? slice.high[1] - v : slice.low[1] + v;
        const LeafCode code = codes[i * stride[0] + j * stride[1]];
        if (code == kEmptyLeaf) continue;
        Mask rays = one_cell ? slice.here : in_cell(cells_[Depth], slice.here, i, j);
        if constexpr (AnyHit) rays &= active_;
        count_cell(slice.here, rays);
        if (rays == 0) continue;
        if constexpr (Depth == 0) {
          if ((code & kLeafCountMask) == kNoLeaf) {
            const grid::Level& inner = grid_.levels()[code >> kLeafShift];
            const std::uint32_t last = inner.cells_on(along_) - 1;
            search<1>(inner, rays, descending_ ? Order{last, 0} : Order{0, last});
            continue;
          }
        }
        if (const Mask fresh = Base::new_to(code, rays); fresh != 0) Base::leaf(code, fresh);
      }
    }
  }

  /// Of the rays of `mask` those that are in the cell.
  ARBORETUM_INLINE Mask in_cell(const RayCells& cells, Mask mask, std::uint32_t i, std::uint32_t j) const {
    const F at[2] = {F(float(i)), F(float(j))};
    Mask rays = 0;
    for (int c = 0; c < chunks_; ++c) {
      const unsigned in = Base::lanes_of(mask, c);
      if (in == 0) continue;
      const int k = c * W;
      vm<W> inside = vm<W>::from_bits(in);
      for (int a = 0; a < 2; ++a)
        inside = inside & (F::load(cells.low[a] + k) <= at[a]) & (at[a] <= F::load(cells.high[a] + k));
      rays |= Mask(inside.bits()) << k;
    }
    return rays;
  }

  /// From a slice on that they enter at `face`, or from their start where it is the first.
  void go_on_alone(Mask rays, float face, bool from_start) {
    Base::go_on_alone(rays, [&](int i, auto& visits) {
      const Ray& ray = rays_[i];
      const float start = AnyHit ? ray.tfar : ray.tnear;
      const float at = (face - lanes_.rays.origin[along_][i]) * lanes_.r[along_][i];
      const float later = AnyHit ? std::min(start, at) : std::max(start, at);
      return walk_grid<AnyHit>(grid_, ray, {from_start ? start : later, true}, best_[i], last_leaf_[i], counting_,
                               visits);
    });
  }

  /// The rays of `mask` come to a level together.
  void count_levels([[maybe_unused]] Mask mask) const {
    if constexpr (Counting::kCounting) {
      counting_.counters.nodes += std::uint64_t(__builtin_popcountll(mask));
      counting_.share_node(unsigned(__builtin_popcountll(mask)));
    }
  }
  /// The rays of a slice were tested against a cell of it that is not empty; `in` are in it.
  void count_cell([[maybe_unused]] Mask slice, [[maybe_unused]] Mask in) const {
    if constexpr (Counting::kCounting) {
      counting_.box_tests(Base::lanes_with(slice), unsigned(__builtin_popcountll(slice)));
      counting_.counters.boxes_hit += std::uint64_t(__builtin_popcountll(in));
    }
  }

  const grid::Grid& grid_;
  const bool padded_;
  int along_ = 0, across_[2] = {1, 2};  ///< axes
  bool descending_ = false;             ///< slices come in the order of falling coordinates
  RayCells cells_[2];
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
