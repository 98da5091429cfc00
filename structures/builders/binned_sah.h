// Binned SAH builder (Wald, "On fast construction of SAH-based bounding volume hierarchies", RT 2007): top down, all
// three axes binned in one pass over the references, the cheapest plane taken.
//
// A reference is 32 bytes, [-lower, id, upper, 0], so that merging boxes is one maximum of eight lanes. Partition is
// out of place, stable and branchless, and gathers the children's centroid bounds on its way. The work is cut into chunks whose size does
// not depend on the number of threads, and minima, maxima and counts do not depend on order: the tree is the same for
// any number of threads. No fused arithmetic, so it is the same on any ISA, too.
#pragma once

#include "simd/simd.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

class BinnedSah {
 public:
  BinnedSah(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, BinaryTree& tree)
      : mesh_(mesh), max_bins_(parameters.bins), leaf_width_(leaf_width), tree_(tree) {}

  void build(BuildReport& report) {
    const std::size_t n = mesh_.size();
    double start = wall_seconds();
    const auto phase = [&](const char* name) {
      const double now = wall_seconds();
      report.phases.emplace_back(name, now - start);
      start = now;
    };
    references_[0].resize(n), references_[1].resize(n);
    // Fewer than n / kParallel + 1 pools (both sides of a split into tasks are larger than that) leave a block unfinished each.
    tree_.nodes.resize(2 * n + (n / kParallel + 2) * kNodeBlock), tree_.first.resize(tree_.nodes.size()), tree_.primitives.resize(n);
    const Range root = make_references(n);
    phase("references");
    NodePool pool;
    recurse(root, 0, pool);
    tree_.node_count = next_node_.load();
    phase("splits");
  }

 private:
  using Box = vf<8>;  // [-lower.xyz, any, upper.xyz, any]
  struct alignas(32) Reference {
    float neg_lower[3];
    std::uint32_t id;
    float upper[3];
    float zero;
  };
  static_assert(sizeof(Reference) == 32);

  /// References [begin, end) of buffer `side`, with the bounds of their boxes and of their (doubled) centroids.
  struct Range {
    std::size_t begin, end;
    int side;
    Box bounds, centroids;
    std::size_t size() const { return end - begin; }
  };

  static constexpr unsigned kMaxBins = 64;
  static constexpr std::size_t kChunk = 1u << 14;     ///< references a task takes at a time
  static constexpr std::size_t kParallel = 1u << 12;  ///< smaller subtrees are built by one task
  static constexpr std::uint32_t kNodeBlock = 256;

  /// Bins of the three axes, twice over: consecutive references go to different sets, so that a read after a write to the
  /// same bin does not wait.
  struct Bins {
    Box box[2][3][kMaxBins];
    std::int32_t count4[kMaxBins][4];  ///< references by bin, then axis; exact as float below 2^24, good enough above
  };

  struct Split {
    float cost = std::numeric_limits<float>::infinity();
    int axis = -1;
    unsigned bin = 0;
    std::size_t left_count = 0;
  };

  static ARBORETUM_INLINE Box empty_box() { return Box(-std::numeric_limits<float>::infinity()); }
  static ARBORETUM_INLINE vf<4> low_half(Box b) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
    return b.lo;
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
    return vf<4>::load(b.lane);
#else
    return vf<4>(_mm256_castps256_ps128(b.v));
#endif
  }
  static ARBORETUM_INLINE vf<4> high_half(Box b) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
    return b.hi;
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
    return vf<4>::load(b.lane + 4);
#else
    return vf<4>(_mm256_extractf128_ps(b.v, 1));
#endif
  }
  static ARBORETUM_INLINE Box both_halves(vf<4> low, vf<4> high) {
    alignas(32) float v[8];
    low.store(v), high.store(v + 4);
    return Box::load(v);
  }
  /// The centroid, doubled: upper + lower.
  static ARBORETUM_INLINE vf<4> centroid(const Reference& r) { return vf<4>::load(r.upper) - vf<4>::load(r.neg_lower); }

  /// A vertex as four lanes, the fourth of any value; the array's last vertex is not read beyond.
  ARBORETUM_INLINE vf<4> vertex(std::uint32_t v) const {
    if (__builtin_expect(v + 1 < mesh_.vertices.size(), 1)) return vf<4>::load(&mesh_.vertices[v]);
    const Vec3f p = mesh_.vertices[v];
    const float lanes[4] = {p.x, p.y, p.z, 0.0f};
    return vf<4>::load(lanes);
  }

  Range make_references(std::size_t n) {
    struct Bounds {
      Box bounds, centroids;
    };
    const std::size_t chunks = (n + kChunk - 1) / kChunk;
    MeteredVector<Bounds> partial(chunks);
    tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t c) {
      Box bounds = empty_box(), centroids = empty_box();
      Reference* out = references_[0].data();
      for (std::size_t i = c * kChunk, end = std::min(n, i + kChunk); i < end; ++i) {
        const Triangle t = mesh_.triangles[i];
        const vf<4> a = vertex(t.a), b = vertex(t.b), d = vertex(t.c);
        const vf<4> lower = min_x86(min_x86(a, b), d), upper = max_x86(max_x86(a, b), d);
        (-lower).store(out[i].neg_lower);
        upper.store(out[i].upper);
        out[i].id = std::uint32_t(i), out[i].zero = 0.0f;
        bounds = max_x86(Box::load(&out[i]), bounds);
        const vf<4> c2 = centroid(out[i]);
        centroids = max_x86(both_halves(-c2, c2), centroids);
      }
      partial[c].bounds = bounds, partial[c].centroids = centroids;
    });
    Range root{0, n, 0, empty_box(), empty_box()};
    for (const Bounds& p : partial) root.bounds = max_x86(p.bounds, root.bounds), root.centroids = max_x86(p.centroids, root.centroids);
    return root;
  }

  /// Maps a centroid to a bin on each axis.
  struct BinMap {
    vf<4> lower, scale;
    unsigned bins;
    BinMap(const Range& range, unsigned max_bins) {
      const std::size_t n = range.size();
      bins = std::min(max_bins, n < 48 ? 8u : n < 1024 ? 16u : n < 4096 ? 32u : max_bins);  // a sweep costs as much as binning this many
      const vf<4> low = -low_half(range.centroids), extent = high_half(range.centroids) - low;
      lower = low;
      // A flat axis gets scale 0: all in bin 0, and no split there.
      scale = select(extent > vf<4>(std::numeric_limits<float>::min()), vf<4>(float(bins) * 0.9999f) / extent, vf<4>(0.0f));
    }
    ARBORETUM_INLINE void operator()(const Reference& r, std::int32_t* bin) const {
      truncate_to_int((centroid(r) - lower) * scale).store(bin);
    }
  };

  static void clear(Bins& bins, unsigned n, int sets) {
    for (int axis = 0; axis < 3; ++axis) {
      for (int set = 0; set < sets; ++set) {
        for (unsigned b = 0; b < n; ++b) bins.box[set][axis][b] = empty_box();
      }
    }
    std::memset(bins.count4, 0, n * sizeof bins.count4[0]);
  }

  static void bin(const Reference* r, const Reference* end, const BinMap& map, Bins& bins) {
    const int sets = end - r < 64 ? 1 : 2;
    clear(bins, map.bins, sets);
    const auto put = [&](const Reference& ref, int set) {
      alignas(16) std::int32_t b[4];
      map(ref, b);
      const Box box = Box::load(&ref);
      for (int axis = 0; axis < 3; ++axis) {
        bins.box[set][axis][b[axis]] = max_x86(box, bins.box[set][axis][b[axis]]);
        ++bins.count4[b[axis]][axis];
      }
    };
    if (sets == 1) {
      for (; r < end; ++r) put(*r, 0);
      return;
    }
    for (; r + 1 < end; r += 2) put(r[0], 0), put(r[1], 1);
    if (r < end) put(*r, 0);
    for (int axis = 0; axis < 3; ++axis) {
      for (unsigned b = 0; b < map.bins; ++b) bins.box[0][axis][b] = max_x86(bins.box[0][axis][b], bins.box[1][axis][b]);
    }
  }

  static void merge(Bins& into, const Bins& from, unsigned n) {
    for (int axis = 0; axis < 3; ++axis) {
      for (unsigned b = 0; b < n; ++b) {
        into.box[0][axis][b] = max_x86(into.box[0][axis][b], from.box[0][axis][b]);
        into.count4[b][axis] += from.count4[b][axis];
      }
    }
  }

  /// Half the areas of three boxes, in lanes 0 to 2.
  static ARBORETUM_INLINE vf<4> half_areas(const Box (&box)[3]) {
    const vf<4> a = high_half(box[0]) + low_half(box[0]), b = high_half(box[1]) + low_half(box[1]), c = high_half(box[2]) + low_half(box[2]);
    vf<4> x, y, z;
    transpose(a, b, c, x, y, z);
    return x * (y + z) + y * z;
  }

  /// Rows a, b, c of x y z become columns: x holds the three first components.
  static ARBORETUM_INLINE void transpose(vf<4> a, vf<4> b, vf<4> c, vf<4>& x, vf<4>& y, vf<4>& z) {
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

  static ARBORETUM_INLINE vf<4> counts_of(const Bins& bins, unsigned b) {
    return to_float(vi<4>::load(bins.count4[b]));
  }

  /// The cheapest plane: area times blocks on both sides, a block holding leaf_width_ references; the three axes in lanes.
  Split best_split(const Bins& bins, unsigned n, std::size_t total) const {
    const vf<4> per_block(1.0f / float(leaf_width_)), one(1.0f), zero(0.0f), none(std::numeric_limits<float>::infinity());
    vf<4> right_cost[kMaxBins];
    Box box[3] = {empty_box(), empty_box(), empty_box()};
    vf<4> count(0.0f);
    for (unsigned b = n; --b > 0;) {
      for (int axis = 0; axis < 3; ++axis) box[axis] = max_x86(bins.box[0][axis][b], box[axis]);
      count = count + counts_of(bins, b);
      right_cost[b] = select(count > zero, half_areas(box) * max_x86(count * per_block, one), none);
    }
    for (Box& side : box) side = empty_box();
    count = vf<4>(0.0f);
    vf<4> best_cost = none;
    vi<4> best_bin(0);
    for (unsigned b = 1; b < n; ++b) {
      for (int axis = 0; axis < 3; ++axis) box[axis] = max_x86(bins.box[0][axis][b - 1], box[axis]);
      count = count + counts_of(bins, b - 1);
      const vf<4> cost = select(count > zero, half_areas(box) * max_x86(count * per_block, one) + right_cost[b], none);
      const vm<4> better = cost < best_cost;
      best_cost = select(better, cost, best_cost);
      best_bin = select(better, vi<4>(std::int32_t(b)), best_bin);
    }
    alignas(16) float costs[4];
    alignas(16) std::int32_t planes[4];
    best_cost.store(costs), best_bin.store(planes);
    Split best;
    for (int axis = 0; axis < 3; ++axis) {
      if (costs[axis] < best.cost) best = {costs[axis], axis, unsigned(planes[axis]), 0};
    }
    if (best.axis < 0) return best;
    for (unsigned b = 0; b < best.bin; ++b) best.left_count += std::uint32_t(bins.count4[b][best.axis]);
    if (best.left_count == total) best.axis = -1;
    return best;
  }

  /// Box of the bins on each side of a split.
  static void child_bounds(const Bins& bins, unsigned n, const Split& split, Box& left, Box& right) {
    left = right = empty_box();
    for (unsigned b = 0; b < split.bin; ++b) left = max_x86(bins.box[0][split.axis][b], left);
    for (unsigned b = split.bin; b < n; ++b) right = max_x86(bins.box[0][split.axis][b], right);
  }

  /// Moves references [r, end) to left_out and right_out, in order; returns the sides' centroid bounds.
  static void partition(const Reference* r, const Reference* end, const BinMap& map, const Split& split, Reference* left_out,
                        Reference* right_out, Box& left_centroids, Box& right_centroids) {
    vf<4> bounds[4] = {-std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity(),
                       -std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity()};
    const vf<4> none = -std::numeric_limits<float>::infinity();
    const float lower = lane_of(map.lower, split.axis), scale = lane_of(map.scale, split.axis);
    for (; r < end; ++r) {
      const vf<4> c = centroid(*r);
      const float position = r->upper[split.axis] - r->neg_lower[split.axis];
      const bool left = std::int32_t((position - lower) * scale) < std::int32_t(split.bin);
      const Box box = Box::load(r);
      box.store(left ? left_out : right_out);
      left_out += left, right_out += !left;
      const vm<4> is_left(left);
      const vf<4> l = select(is_left, c, none), neg_l = select(is_left, -c, none);
      const vf<4> h = select(is_left, none, c), neg_h = select(is_left, none, -c);
      bounds[0] = max_x86(neg_l, bounds[0]), bounds[1] = max_x86(l, bounds[1]);
      bounds[2] = max_x86(neg_h, bounds[2]), bounds[3] = max_x86(h, bounds[3]);
    }
    left_centroids = both_halves(bounds[0], bounds[1]);
    right_centroids = both_halves(bounds[2], bounds[3]);
  }

  static float lane_of(vf<4> v, int lane) {
    alignas(16) float lanes[4];
    v.store(lanes);
    return lanes[lane];
  }

  void make_node(std::uint32_t index, const Range& range, std::uint32_t left) {
    alignas(32) float b[8];
    range.bounds.store(b);
    tree_.nodes[index] = {{0.0f - b[0], 0.0f - b[1], 0.0f - b[2]}, left, {b[4], b[5], b[6]}, std::uint32_t(range.size())};
  }

  void make_leaf(std::uint32_t index, const Range& range) {
    make_node(index, range, 0);
    tree_.first[index] = std::uint32_t(range.begin);
    const Reference* r = references_[range.side].data();
    for (std::size_t i = range.begin; i < range.end; ++i) tree_.primitives[i] = r[i].id;
  }

  /// Splits a range whose centroids coincide in the middle of its order.
  void split_in_the_middle(const Range& range, Range& left, Range& right) const {
    const std::size_t middle = range.begin + range.size() / 2;
    left = {range.begin, middle, range.side, empty_box(), empty_box()};
    right = {middle, range.end, range.side, empty_box(), empty_box()};
    for (Range* half : {&left, &right}) {
      for (std::size_t i = half->begin; i < half->end; ++i) {
        const Reference& r = references_[range.side][i];
        const vf<4> c = centroid(r);
        half->bounds = max_x86(Box::load(&r), half->bounds);
        half->centroids = max_x86(both_halves(-c, c), half->centroids);
      }
    }
  }

  void split_small(const Range& range, Range& left, Range& right) {
    Bins bins;
    const BinMap map(range, max_bins_);
    const Reference* r = references_[range.side].data();
    bin(r + range.begin, r + range.end, map, bins);
    const Split split = best_split(bins, map.bins, range.size());
    if (split.axis < 0) return split_in_the_middle(range, left, right);
    const std::size_t middle = range.begin + split.left_count;
    left = {range.begin, middle, 1 - range.side, {}, {}}, right = {middle, range.end, 1 - range.side, {}, {}};
    child_bounds(bins, map.bins, split, left.bounds, right.bounds);
    Reference* out = references_[1 - range.side].data();
    partition(r + range.begin, r + range.end, map, split, out + left.begin, out + right.begin, left.centroids, right.centroids);
  }

  /// The same in parallel: every chunk keeps its own bins, which also say where its two sides go.
  void split_large(const Range& range, Range& left, Range& right) {
    const std::size_t chunks = (range.size() + kChunk - 1) / kChunk;
    const BinMap map(range, max_bins_);
    const Reference* r = references_[range.side].data();
    MeteredVector<Bins> bins(chunks);
    const auto bounds_of = [&](std::size_t c) { return std::pair{range.begin + c * kChunk, std::min(range.end, range.begin + (c + 1) * kChunk)}; };
    tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t c) {
      const auto [begin, end] = bounds_of(c);
      bin(r + begin, r + end, map, bins[c]);
    });
    Bins total;
    clear(total, map.bins, 1);
    for (const Bins& b : bins) merge(total, b, map.bins);
    const Split split = best_split(total, map.bins, range.size());
    if (split.axis < 0) return split_in_the_middle(range, left, right);
    const std::size_t middle = range.begin + split.left_count;
    left = {range.begin, middle, 1 - range.side, empty_box(), empty_box()}, right = {middle, range.end, 1 - range.side, empty_box(), empty_box()};
    child_bounds(total, map.bins, split, left.bounds, right.bounds);
    struct Target {
      std::size_t left, right;
      Box left_centroids, right_centroids;
    };
    MeteredVector<Target> targets(chunks);
    std::size_t l = left.begin, h = right.begin;
    for (std::size_t c = 0; c < chunks; ++c) {
      targets[c].left = l, targets[c].right = h;
      std::size_t to_left = 0;
      for (unsigned b = 0; b < split.bin; ++b) to_left += std::size_t(bins[c].count4[b][split.axis]);
      const auto [begin, end] = bounds_of(c);
      l += to_left, h += end - begin - to_left;
    }
    Reference* out = references_[1 - range.side].data();
    tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t c) {
      const auto [begin, end] = bounds_of(c);
      Target& t = targets[c];
      partition(r + begin, r + end, map, split, out + t.left, out + t.right, t.left_centroids, t.right_centroids);
    });
    for (const Target& t : targets) {
      left.centroids = max_x86(t.left_centroids, left.centroids), right.centroids = max_x86(t.right_centroids, right.centroids);
    }
  }

  /// Node indices that one task may give out.
  struct NodePool {
    std::uint32_t next = 0, end = 0;
  };

  /// Two neighbouring nodes. Tasks take indices in blocks, so that a task's nodes lie together and the array's used part stays
  /// dense; numbers depend on scheduling, the tree does not.
  std::uint32_t take_pair(NodePool& pool) {
    if (pool.next + 2 > pool.end) {
      pool.next = next_node_.fetch_add(kNodeBlock, std::memory_order_relaxed);
      pool.end = pool.next + kNodeBlock;
    }
    pool.next += 2;
    return pool.next - 2;
  }

  void recurse(const Range& range, std::uint32_t index, NodePool& pool) {
    if (range.size() <= leaf_width_) return make_leaf(index, range);
    Range left, right;
    if (range.size() > 4 * kChunk) {
      split_large(range, left, right);
    } else {
      split_small(range, left, right);
    }
    const std::uint32_t first = take_pair(pool);
    make_node(index, range, first);
    if (left.size() > kParallel && right.size() > kParallel) {
      tbb::parallel_invoke(
          [&] {
            NodePool own;
            recurse(left, first, own);
          },
          [&] { recurse(right, first + 1, pool); });
    } else {
      recurse(left, first, pool);
      recurse(right, first + 1, pool);
    }
  }

  const TriangleMesh& mesh_;
  const unsigned max_bins_;
  const unsigned leaf_width_;
  BinaryTree& tree_;
  MeteredVector<Reference> references_[2];
  std::atomic<std::uint32_t> next_node_{1};  // 0 is the root
};

inline void build_binned_sah(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, BinaryTree& tree, BuildReport& report) {
  BinnedSah(mesh, parameters, leaf_width, tree).build(report);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
