// Binned SAH: references are counted by the bins in which their boxes begin and end (Popov, Guenther, Seidel,
// Slusallek, "Experiences with streaming construction of SAH kd-trees", RT 2006; Shevtsov, Soupikov, Kapustin, "Highly
// parallel fast kd-tree construction", EG 2007). The bins span the references' common bounds, not the cell, so that the
// first and last planes are those that cut off empty space exactly.
#include <algorithm>
#include <cstring>

#include <emmintrin.h>
#include <tbb/parallel_for.h>

#include "structures/builders/phase_clock.h"
#include "structures/kdtree/builders.h"

namespace arboretum::kdtree {
namespace {

constexpr unsigned kMaxBins = 64;

/// begins[b][axis]: boxes whose lower bound lies in bin b; ends[b + 1][axis]: whose upper bound does, one on a plane
/// belonging to the bin before. The fourth lane holds nothing.
struct Bins {
  alignas(16) std::int32_t begins[kMaxBins][4], ends[kMaxBins + 1][4];
  void clear(int n) {
    std::memset(begins, 0, std::size_t(n) * sizeof begins[0]),
        std::memset(ends, 0, std::size_t(n + 1) * sizeof ends[0]);
  }
};

/// Maps coordinates to bins, the axes in lanes (SSE2, which every x86-64 has); a flat axis has scale 0.
struct BinMap {
  alignas(16) float lower[4] = {}, scale[4] = {}, width[4] = {};
  int bins;

  BinMap(const Bounds3f& bounds, unsigned n) : bins(int(n)) {
    for (std::size_t k = 0; k < 3; ++k) {
      // Where that is more than a float holds the bins end before the bounds, and what lies beyond is in the last one.
      const float extent = std::min(bounds.upper[k] - bounds.lower[k], std::numeric_limits<float>::max());
      lower[k] = bounds.lower[k];
      const bool thick = extent > std::numeric_limits<float>::min() * float(kMaxBins);
      scale[k] = thick ? float(n) / extent : 0.0f;
      width[k] = thick ? extent / float(n) : 0.0f;
    }
  }
  void count(const Reference& r, Bins& out) const {
    const __m128 low = _mm_load_ps(lower), by = _mm_load_ps(scale), last = _mm_set1_ps(float(bins - 1)),
                 most = _mm_set1_ps(float(bins));
    const __m128 begin = _mm_min_ps(_mm_mul_ps(_mm_sub_ps(_mm_loadu_ps(&r.box.lower.x), low), by), last);
    // Behind the upper corner stands the id, which is subnormal as a float: slow to multiply.
    const __m128 upper = _mm_and_ps(_mm_loadu_ps(&r.box.upper.x), _mm_castsi128_ps(_mm_setr_epi32(-1, -1, -1, 0)));
    const __m128 end = _mm_min_ps(_mm_mul_ps(_mm_sub_ps(upper, low), by), most);
    const __m128i whole = _mm_cvttps_epi32(end);
    alignas(16) std::int32_t b[4], e[4];  // e: rounded up, which is the bin's number + 1
    _mm_store_si128(reinterpret_cast<__m128i*>(b), _mm_cvttps_epi32(begin));
    const __m128i fraction = _mm_castps_si128(_mm_cmplt_ps(_mm_cvtepi32_ps(whole), end));
    _mm_store_si128(reinterpret_cast<__m128i*>(e), _mm_sub_epi32(whole, fraction));
    ++out.begins[b[0]][0], ++out.begins[b[1]][1], ++out.begins[b[2]][2];
    ++out.ends[e[0]][0], ++out.ends[e[1]][1], ++out.ends[e[2]][2];
  }
  [[nodiscard]] float plane(int b, std::size_t k) const { return lower[k] + width[k] * float(b); }
};

class Binned {
 public:
  struct State {
    References references;
    [[nodiscard]] std::size_t size() const { return references.size(); }
    void append_ids(MeteredVector<std::uint32_t>& ids) const {
      for (const Reference& r : references) ids.push_back(r.id);
    }
  };

  Binned(const TriangleMesh& mesh, const BoxPads& pads, const CostModel& model, unsigned bins)
      : mesh_(mesh), pads_(pads), model_(model), max_bins_(bins) {}

  Split find(const State& state, const Bounds3f& cell, bool parallel) const {
    const References& references = state.references;
    const std::size_t n = references.size();
    const Bounds3f bounds = bounds_of(references, parallel);
    const BinMap map(bounds, std::min(max_bins_, n < 32 ? 8u : n < 256 ? 16u : 64u));
    Bins bins;
    bins.clear(map.bins);
    if (!parallel || n < 2 * kChunk) {
      count(references.data(), references.data() + n, map, bins);
    } else {
      const std::size_t chunks = (n + kChunk - 1) / kChunk;
      MeteredVector<Bins> partial(chunks);
      tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t c) {
        partial[c].clear(map.bins);
        count(references.data() + c * kChunk, references.data() + std::min(n, (c + 1) * kChunk), map, partial[c]);
      });
      for (const Bins& p : partial) add(bins, p, map.bins);
    }
    return cheapest(map, bins, bounds, cell, n);
  }

  void divide(const State& state, const Split& split, const Bounds3f& cell, State& left, State& right,
              bool parallel) const {
    const References& in = state.references;
    left.references.clear(), right.references.clear();
    if (!parallel || in.size() < 2 * kChunk) {
      divide(in.data(), in.data() + in.size(), split, cell, left.references, right.references);
      return;
    }
    const std::size_t chunks = (in.size() + kChunk - 1) / kChunk;
    std::vector<References> l(chunks), r(chunks);
    tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t c) {
      divide(in.data() + c * kChunk, in.data() + std::min(in.size(), (c + 1) * kChunk), split, cell, l[c], r[c]);
    });
    join(l, left.references), join(r, right.references);
  }

 private:
  static Bounds3f bounds_of(const References& references, bool parallel) {
    const auto over = [](const Reference* r, const Reference* end) {
      __m128 lower = _mm_set1_ps(std::numeric_limits<float>::infinity()),
             upper = _mm_set1_ps(-std::numeric_limits<float>::infinity());
      for (; r != end; ++r)
        lower = _mm_min_ps(_mm_loadu_ps(&r->box.lower.x), lower),
        upper = _mm_max_ps(_mm_loadu_ps(&r->box.upper.x), upper);
      alignas(16) float l[4], u[4];
      _mm_store_ps(l, lower), _mm_store_ps(u, upper);
      return Bounds3f{{l[0], l[1], l[2]}, {u[0], u[1], u[2]}};
    };
    const std::size_t n = references.size();
    if (!parallel || n < 2 * kChunk) return over(references.data(), references.data() + n);
    std::vector<Bounds3f> partial((n + kChunk - 1) / kChunk);
    tbb::parallel_for(std::size_t{0}, partial.size(), [&](std::size_t c) {
      partial[c] = over(references.data() + c * kChunk, references.data() + std::min(n, (c + 1) * kChunk));
    });
    Bounds3f bounds;
    for (const Bounds3f& b : partial) bounds.extend(b);
    return bounds;
  }

  static void count(const Reference* r, const Reference* end, const BinMap& map, Bins& bins) {
    for (; r != end; ++r) map.count(*r, bins);
  }

  static void add(Bins& into, const Bins& from, int n) {
    for (int b = 0; b <= n; ++b) {
      for (std::size_t k = 0; k < 3; ++k) {
        if (b < n) into.begins[b][k] += from.begins[b][k];
        into.ends[b][k] += from.ends[b][k];
      }
    }
  }

  /// The bins' planes are compared in float, three axes at once; what is best on an axis, and the planes that cut off
  /// empty space, exactly.
  Split cheapest(const BinMap& map, const Bins& bins, const Bounds3f& bounds, const Bounds3f& cell,
                 std::size_t n) const {
    const AxisCost cost[3] = {{model_, cell, 0}, {model_, cell, 1}, {model_, cell, 2}};
    // Shares of the sides of plane b: left + b * step and right - b * step.
    alignas(16) float share_left[4] = {}, share_right[4] = {}, share_step[4] = {};
    for (std::size_t k = 0; k < 3; ++k) {
      share_left[k] = float(cost[k].share_left(map.lower[k])),
      share_right[k] = float(cost[k].share_right(map.lower[k]));
      share_step[k] = float(cost[k].share_left(double(map.lower[k]) + map.width[k]) - cost[k].share_left(map.lower[k]));
    }
    const __m128 from_left = _mm_load_ps(share_left), from_right = _mm_load_ps(share_right),
                 step = _mm_load_ps(share_step);
    const __m128 per_block = _mm_set1_ps(float(model_.per_block)), one = _mm_set1_ps(1.0f);
    __m128i left = _mm_setzero_si128(), right = _mm_sub_epi32(_mm_set1_epi32(std::int32_t(n)), row(bins.ends[0]));
    __m128 least = _mm_set1_ps(std::numeric_limits<float>::infinity());
    __m128i at = _mm_setzero_si128();
    for (int b = 1; b < map.bins; ++b) {
      left = _mm_add_epi32(left, row(bins.begins[b - 1])), right = _mm_sub_epi32(right, row(bins.ends[b]));
      const __m128 moved = _mm_mul_ps(step, _mm_set1_ps(float(b)));
      const __m128 sum = _mm_add_ps(_mm_mul_ps(_mm_add_ps(from_left, moved), blocks(left, per_block, one)),
                                    _mm_mul_ps(_mm_sub_ps(from_right, moved), blocks(right, per_block, one)));
      const __m128 less = _mm_cmplt_ps(sum, least);
      least = _mm_min_ps(sum, least);
      at = _mm_or_si128(_mm_and_si128(_mm_castps_si128(less), _mm_set1_epi32(b)),
                        _mm_andnot_si128(_mm_castps_si128(less), at));
    }
    alignas(16) std::int32_t chosen[4];
    _mm_store_si128(reinterpret_cast<__m128i*>(chosen), at);
    Split best;
    for (std::size_t k = 0; k < 3; ++k) {
      if (cost[k].flat()) continue;
      cost[k].consider(bounds.lower[k], 0, n, false, best);
      cost[k].consider(bounds.upper[k], n, 0, true, best);
      if (chosen[k] == 0 || map.scale[k] == 0.0f) continue;
      std::size_t begun = 0, ended = std::size_t(bins.ends[0][k]);
      for (int b = 0; b < chosen[k]; ++b)
        begun += std::size_t(bins.begins[b][k]), ended += std::size_t(bins.ends[b + 1][k]);
      cost[k].consider(map.plane(chosen[k], k), begun, n - ended, true, best);
    }
    return best;
  }

  static __m128i row(const std::int32_t* counts) { return _mm_load_si128(reinterpret_cast<const __m128i*>(counts)); }
  static __m128 blocks(__m128i references, __m128 per_block, __m128 one) {
    const __m128 n = _mm_cvtepi32_ps(references);
    return _mm_and_ps(_mm_cmpgt_ps(n, _mm_setzero_ps()), _mm_max_ps(_mm_mul_ps(n, per_block), one));
  }

  void divide(const Reference* r, const Reference* end, const Split& split, const Bounds3f& cell, References& left,
              References& right) const {
    for (; r != end; ++r) {
      switch (side_of(r->box, split)) {
        case Side::left: left.push_back(*r); break;
        case Side::right: right.push_back(*r); break;
        case Side::both: {
          Bounds3f l, h;
          divide_reference(mesh_, pads_, *r, split, cell, l, h);
          if (!l.empty()) left.push_back({l, r->id});
          if (!h.empty()) right.push_back({h, r->id});
        }
      }
    }
  }

  static void join(std::vector<References>& parts, References& out) {
    std::vector<std::size_t> begin(parts.size() + 1, 0);
    for (std::size_t c = 0; c < parts.size(); ++c) begin[c + 1] = begin[c] + parts[c].size();
    out.resize(begin.back());
    tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t c) {
      std::copy(parts[c].begin(), parts[c].end(), out.begin() + std::ptrdiff_t(begin[c]));
      References().swap(parts[c]);
    });
  }

  const TriangleMesh& mesh_;
  const BoxPads& pads_;
  const CostModel& model_;
  const unsigned max_bins_;
};

}  // namespace

void build_binned(const TriangleMesh& mesh, const BoxPads& pads, const BuilderParameters& parameters,
                  const CostModel& model, const Limits& limits, const Bounds3f& cell, Part& out, BuildReport& report) {
  PhaseClock phase(report);
  Binned::State root{make_references(mesh, pads)};
  phase.ends("references");
  const Binned method(mesh, pads, model, parameters.bins);
  TopDown<Binned>(method, model, limits).build(std::move(root), cell, out);
  phase.ends("splits");
}

}  // namespace arboretum::kdtree
