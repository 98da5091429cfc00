// What the binned SAH builders share: references, the bins of three axes, the sweep over them, the partition.
//
// A reference is 32 bytes, [-lower, id, upper, 0], so that merging boxes is one maximum of eight lanes. Minima, maxima
// and counts do not depend on order and no arithmetic is fused, so bins are the same however the references are cut
// into chunks, and on any ISA.
#pragma once

#include "simd/simd.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {
namespace sah {

using Box = vf<8>;  ///< [-lower.xyz, any, upper.xyz, any]

struct alignas(32) Reference {
  float neg_lower[3];
  std::uint32_t id;
  float upper[3];
  float zero;
};
static_assert(sizeof(Reference) == 32);

inline constexpr unsigned kMaxBins = 64;
inline constexpr unsigned kManyBins = 256;         ///< 8 times as many bins, at most these, above kLarge references
inline constexpr float kFlat = 1e-36f;             ///< no splits across less: kManyBins / kFlat is finite
inline constexpr std::size_t kChunk = 1u << 14;    ///< references a task takes at a time
inline constexpr std::size_t kLarge = 4 * kChunk;  ///< more references than this are split by several tasks

/// What falls into the bins of one number, on each of the three axes.
struct alignas(32) Bin {
  Box box[3];
  std::int32_t count[4];  ///< exact as float below 2^24, good enough above
};
template <unsigned N>
struct BinSet {
  static constexpr unsigned kMost = N;
  Bin bin[N];
};
using Bins = BinSet<kMaxBins>;
/// For more than kLarge references. A few planes decide there what all levels below have to do with, and a sweep costs
/// little beside the binning.
using ManyBins = BinSet<kManyBins>;

struct Split {
  float cost = std::numeric_limits<float>::infinity();
  int axis = -1;
  unsigned bin = 0;
  std::size_t left_count = 0;
};

ARBORETUM_INLINE Box empty_box() { return Box(-std::numeric_limits<float>::infinity()); }
ARBORETUM_INLINE vf<4> low_half(Box b) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
  return b.lo;
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
  return vf<4>::load(b.lane);
#else
  return vf<4>(_mm256_castps256_ps128(b.v));
#endif
}
ARBORETUM_INLINE vf<4> high_half(Box b) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
  return b.hi;
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
  return vf<4>::load(b.lane + 4);
#else
  return vf<4>(_mm256_extractf128_ps(b.v, 1));
#endif
}
ARBORETUM_INLINE Box both_halves(vf<4> low, vf<4> high) {
#if ARBORETUM_TARGET >= ARBORETUM_TARGET_AVX2
  return Box(_mm256_insertf128_ps(_mm256_castps128_ps256(low.v), high.v, 1));
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
  return {low, high};
#else
  alignas(32) float v[8];
  low.store(v), high.store(v + 4);
  return Box::load(v);
#endif
}
/// The centroid, doubled: upper + lower.
ARBORETUM_INLINE vf<4> centroid(const Reference& r) { return vf<4>::load(r.upper) - vf<4>::load(r.neg_lower); }
/// The first three lanes, and 0. Behind a reference's coordinates stands its id, which is subnormal as a float: slow to
/// multiply.
ARBORETUM_INLINE vf<4> three_lanes(vf<4> v) { return select(vm<4>::from_bits(7u), v, vf<4>(0.0f)); }

inline float lane_of(vf<4> v, int lane) {
  alignas(16) float lanes[4];
  v.store(lanes);
  return lanes[lane];
}

/// Maps a centroid to a bin on each axis.
struct BinMap {
  vf<4> lower, scale;
  unsigned bins;
  bool finite;  ///< else there are centroids, or distances between them, beyond float, and no bins for them
  BinMap(Box centroids, std::size_t n, unsigned max_bins) {
    // a sweep costs as much as binning this many
    bins = std::min(max_bins, n < 32 ? 8u : n < 512 ? 16u : n < 4096 ? 32u : max_bins);
    if (n > kLarge) bins = std::min(8 * bins, kManyBins);
    const vf<4> low = -low_half(centroids), extent = high_half(centroids) - low;
    lower = low;
    finite = ((extent < vf<4>(std::numeric_limits<float>::infinity())).bits() & 7u) == 7u;
    // A flat axis, or one whose scale would overflow, gets scale 0: all in bin 0, and no split there.
    scale = select(extent > vf<4>(kFlat), vf<4>(float(bins) * 0.9999f) / extent, vf<4>(0.0f));
  }
  ARBORETUM_INLINE void operator()(const Reference& r, std::int32_t* bin) const {
    truncate_to_int(three_lanes(centroid(r) - lower) * scale).store(bin);
  }
};

template <class B>
void clear(B& bins, unsigned n) {
  for (unsigned b = 0; b < n; ++b) {
    for (Box& box : bins.bin[b].box) box = empty_box();
    vi<4>(0).store(bins.bin[b].count);
  }
}

/// The bins of references [r, end), taken from four places in turn: neighbours mostly go to the same bin, where each
/// would wait for the one before.
template <class B>
void bin(const Reference* r, const Reference* end, const BinMap& map, B& bins) {
  clear(bins, map.bins);
  const auto put = [&](const Reference& ref, const std::int32_t* number) {
    const Box box = Box::load(&ref);
    for (int axis = 0; axis < 3; ++axis) {
      Bin& bin = bins.bin[number[axis]];
      bin.box[axis] = max_x86(box, bin.box[axis]);
      ++bin.count[axis];
    }
  };
  constexpr std::size_t kPlaces = 4, kAhead = 16;
  // Found for some references before any is put: stores and later loads keep out of each other's way
  alignas(16) std::int32_t numbers[kAhead][kPlaces][4];
  const std::size_t part = std::size_t(end - r) / kPlaces;
  for (std::size_t begin = 0; begin < part; begin += kAhead) {
    const std::size_t n = std::min(kAhead, part - begin);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = 0; k < kPlaces; ++k) map(r[k * part + begin + i], numbers[i][k]);
    }
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t k = 0; k < kPlaces; ++k) put(r[k * part + begin + i], numbers[i][k]);
    }
  }
  for (r += kPlaces * part; r < end; ++r) map(*r, numbers[0][0]), put(*r, numbers[0][0]);
}

template <class B>
void merge(B& into, const B& from, unsigned n) {
  for (unsigned b = 0; b < n; ++b) {
    Bin& bin = into.bin[b];
    for (int axis = 0; axis < 3; ++axis) bin.box[axis] = max_x86(bin.box[axis], from.bin[b].box[axis]);
    (vi<4>::load(bin.count) + vi<4>::load(from.bin[b].count)).store(bin.count);
  }
}

/// Rows a, b, c of x y z become columns: x holds the three first components.
ARBORETUM_INLINE void transpose(vf<4> a, vf<4> b, vf<4> c, vf<4>& x, vf<4>& y, vf<4>& z) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
  for (int i = 0; i < 4; ++i) {
    const vf<4>& row = i == 0 ? a : i == 1 ? b : c;
    x.lane[i] = row.lane[0], y.lane[i] = row.lane[1], z.lane[i] = row.lane[2];
  }
#else
  const __m128 ab_low = _mm_unpacklo_ps(a.v, b.v);   // ax bx ay by
  const __m128 ab_high = _mm_unpackhi_ps(a.v, b.v);  // az bz
  x = vf<4>(_mm_movelh_ps(ab_low, c.v));             // ax bx cx cy
  y = vf<4>(_mm_shuffle_ps(ab_low, c.v, _MM_SHUFFLE(1, 1, 3, 2)));
  z = vf<4>(_mm_shuffle_ps(ab_high, c.v, _MM_SHUFFLE(2, 2, 1, 0)));
#endif
}

/// Half the areas of three boxes, in lanes 0 to 2.
ARBORETUM_INLINE vf<4> half_areas(const Box (&box)[3]) {
  const vf<4> a = high_half(box[0]) + low_half(box[0]), b = high_half(box[1]) + low_half(box[1]),
              c = high_half(box[2]) + low_half(box[2]);
  vf<4> x, y, z;
  transpose(a, b, c, x, y, z);
  return x * (y + z) + y * z;
}

template <class B>
ARBORETUM_INLINE vf<4> counts_of(const B& bins, unsigned b) {
  return to_float(vi<4>::load(bins.bin[b].count));
}

/// Leaf blocks that `count` references fill, the last one perhaps in part.
struct BlocksFor {
  vf<4> one_less, per_block;
  explicit BlocksFor(unsigned leaf_width) : one_less(float(leaf_width - 1)), per_block(1.0f / float(leaf_width)) {}
  ARBORETUM_INLINE vf<4> operator()(vf<4> count) const {
    return to_float(truncate_to_int((count + one_less) * per_block));
  }
};

/// The cheapest planes of the three axes so far, in lanes; of equal ones the first.
struct CheapestPlanes {
  vf<4> cost;
  vi<4> bin;
  ARBORETUM_INLINE CheapestPlanes() : cost(std::numeric_limits<float>::infinity()), bin(0) {}
  ARBORETUM_INLINE void offer(vf<4> costs, unsigned b) {
    const vm<4> better = costs < cost;
    cost = select(better, costs, cost);
    bin = select(better, vi<4>(std::int32_t(b)), bin);
  }
  /// Cost, axis and bin of the cheapest of all; `best`, made anew, stays as it is where there is none.
  template <class S>
  ARBORETUM_INLINE void pick(S& best) const {
    alignas(16) float costs[4];
    alignas(16) std::int32_t bins[4];
    cost.store(costs), bin.store(bins);
    for (int axis = 0; axis < 3; ++axis) {
      if (costs[axis] < best.cost) best.cost = costs[axis], best.axis = axis, best.bin = decltype(best.bin)(bins[axis]);
    }
  }
};

/// The cheapest plane: area times blocks on both sides, a block holding leaf_width references; the three axes in lanes.
/// Whole blocks: what a block's last lanes could hold costs the same, and splits that fill blocks save nodes and bytes.
template <class B>
Split best_split(const B& bins, unsigned n, std::size_t total, unsigned leaf_width) {
  const BlocksFor blocks(leaf_width);
  const vf<4> zero(0.0f), none(std::numeric_limits<float>::infinity());
  vf<4> right_cost[B::kMost];
  Box box[3] = {empty_box(), empty_box(), empty_box()};
  vf<4> count(0.0f);
  for (unsigned b = n; --b > 0;) {
    for (int axis = 0; axis < 3; ++axis) box[axis] = max_x86(bins.bin[b].box[axis], box[axis]);
    count = count + counts_of(bins, b);
    right_cost[b] = select(count > zero, half_areas(box) * blocks(count), none);
  }
  for (Box& side : box) side = empty_box();
  count = vf<4>(0.0f);
  CheapestPlanes planes;
  for (unsigned b = 1; b < n; ++b) {
    for (int axis = 0; axis < 3; ++axis) box[axis] = max_x86(bins.bin[b - 1].box[axis], box[axis]);
    count = count + counts_of(bins, b - 1);
    const vf<4> cost = select(count > zero, half_areas(box) * blocks(count) + right_cost[b], none);
    planes.offer(cost, b);
  }
  Split best;
  planes.pick(best);
  if (best.axis < 0) return best;
  for (unsigned b = 0; b < best.bin; ++b) best.left_count += std::uint32_t(bins.bin[b].count[best.axis]);
  if (best.left_count == total) best.axis = -1;
  return best;
}

/// Box of the bins on each side of a split.
template <class B>
void child_bounds(const B& bins, unsigned n, const Split& split, Box& left, Box& right) {
  left = right = empty_box();
  for (unsigned b = 0; b < split.bin; ++b) left = max_x86(bins.bin[b].box[split.axis], left);
  for (unsigned b = split.bin; b < n; ++b) right = max_x86(bins.bin[b].box[split.axis], right);
}

/// Whether a reference lies left of a split.
struct LeftOf {
  float lower, scale;
  int axis;
  std::int32_t bin;
  LeftOf(const BinMap& map, const Split& split)
      : lower(lane_of(map.lower, split.axis)), scale(lane_of(map.scale, split.axis)), axis(split.axis),
        bin(std::int32_t(split.bin)) {}
  ARBORETUM_INLINE bool operator()(const Reference& r) const {
    return std::int32_t((r.upper[axis] - r.neg_lower[axis] - lower) * scale) < bin;
  }
};

/// Bounds of the centroids on the two sides of a split, gathered without branches.
class SideBounds {
 public:
  ARBORETUM_INLINE SideBounds() : left_(empty_box()), right_(empty_box()) {}
  ARBORETUM_INLINE void extend(const Reference& r, bool left) {
    const vf<4> c = centroid(r);
    const Box point = both_halves(-c, c), none = empty_box();
    const vm<8> is_left(left);
    left_ = max_x86(select(is_left, point, none), left_), right_ = max_x86(select(is_left, none, point), right_);
  }
  [[nodiscard]] Box left() const { return left_; }
  [[nodiscard]] Box right() const { return right_; }

 private:
  Box left_, right_;
};

/// Moves references [r, end) to left_out and right_out, in order; returns the sides' centroid bounds.
inline void partition(const Reference* r, const Reference* end, const BinMap& map, const Split& split,
                      Reference* left_out, Reference* right_out, Box& left_centroids, Box& right_centroids) {
  SideBounds bounds;
  const LeftOf is_left(map, split);
  for (; r < end; ++r) {
    const bool left = is_left(*r);
    Box::load(r).store(left ? left_out : right_out);
    left_out += left, right_out += !left;
    bounds.extend(*r, left);
  }
  left_centroids = bounds.left(), right_centroids = bounds.right();
}

/// Writes the places in [r, r + count), at most kChunk, of references that are not on the side `wanted_left` says;
/// returns their number, and the centroid bounds of either side.
inline std::size_t find_misplaced(const Reference* r, std::size_t count, const BinMap& map, const Split& split,
                                  bool wanted_left, std::uint16_t* places, Box& left_centroids, Box& right_centroids) {
  SideBounds bounds;
  const LeftOf is_left(map, split);
  std::size_t found = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const bool left = is_left(r[i]);
    places[found] = std::uint16_t(i);
    found += left != wanted_left;
    bounds.extend(r[i], left);
  }
  left_centroids = bounds.left(), right_centroids = bounds.right();
  return found;
}

}  // namespace sah
}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
