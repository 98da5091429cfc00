// Binned SAH: references are counted by the bins in which their boxes begin and end (Popov, Guenther, Seidel, Slusallek,
// "Experiences with streaming construction of SAH kd-trees", RT 2006; Shevtsov, Soupikov, Kapustin, "Highly parallel fast kd-tree
// construction", EG 2007). The bins span the references' common bounds, not the cell, so that the first and last planes are those
// that cut off empty space exactly.
#include <algorithm>

#include <tbb/parallel_for.h>

#include "core/timer.h"
#include "structures/kdtree/builders.h"

namespace arboretum::kdtree {
namespace {

constexpr unsigned kMaxBins = 64;

/// begins[axis][b]: boxes whose lower bound lies in bin b; ends: whose upper bound does, a bound on a plane belonging to the bin before.
struct Bins {
  std::uint32_t begins[3][kMaxBins] = {}, ends[3][kMaxBins] = {};
};

/// Maps coordinates to bins; a flat axis has scale 0.
struct BinMap {
  float lower[3], scale[3], width[3];
  unsigned bins;

  BinMap(const Bounds3f& bounds, unsigned n) : bins(n) {
    for (std::size_t k = 0; k < 3; ++k) {
      const float extent = bounds.upper[k] - bounds.lower[k];
      lower[k] = bounds.lower[k];
      const bool thick = extent > std::numeric_limits<float>::min() * float(kMaxBins) && extent < std::numeric_limits<float>::max();
      scale[k] = thick ? float(n) / extent : 0.0f;
      width[k] = thick ? extent / float(n) : 0.0f;
    }
  }
  [[nodiscard]] unsigned begin(float x, std::size_t k) const {
    return std::min(unsigned((x - lower[k]) * scale[k]), bins - 1);
  }
  [[nodiscard]] unsigned end(float x, std::size_t k) const {
    const float at = (x - lower[k]) * scale[k];
    const unsigned b = unsigned(at);
    return std::min(b - unsigned(b > 0 && float(b) == at), bins - 1);
  }
  [[nodiscard]] float plane(unsigned b, std::size_t k) const { return lower[k] + width[k] * float(b); }
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

  Binned(const TriangleMesh& mesh, const CostModel& model, unsigned bins) : mesh_(mesh), model_(model), max_bins_(bins) {}

  Split find(const State& state, const Bounds3f& cell, bool parallel) const {
    const References& references = state.references;
    const std::size_t n = references.size();
    const Bounds3f bounds = bounds_of(references, parallel);
    const BinMap map(bounds, std::min(max_bins_, n < 32 ? 8u : n < 256 ? 16u : 64u));
    Bins bins;
    if (!parallel || n < 2 * kChunk) {
      count(references.data(), references.data() + n, map, bins);
    } else {
      const std::size_t chunks = (n + kChunk - 1) / kChunk;
      MeteredVector<Bins> partial(chunks);
      tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t c) {
        partial[c] = Bins{};
        count(references.data() + c * kChunk, references.data() + std::min(n, (c + 1) * kChunk), map, partial[c]);
      });
      for (const Bins& p : partial) add(bins, p, map.bins);
    }
    Split best;
    for (int axis = 0; axis < 3; ++axis) {
      const std::size_t k = std::size_t(axis);
      const AxisCost cost(model_, cell, axis);
      if (cost.flat()) continue;
      cost.consider(bounds.lower[k], 0, n, false, best);
      cost.consider(bounds.upper[k], n, 0, true, best);
      if (map.scale[k] == 0.0f) continue;
      std::size_t left = 0, right = n;
      for (unsigned b = 1; b < map.bins; ++b) {
        left += bins.begins[k][b - 1], right -= bins.ends[k][b - 1];
        cost.consider(map.plane(b, k), left, right, true, best);
      }
    }
    return best;
  }

  void divide(const State& state, const Split& split, const Bounds3f& left_cell, const Bounds3f& right_cell, State& left, State& right,
              bool parallel) const {
    const References& in = state.references;
    left.references.clear(), right.references.clear();
    if (!parallel || in.size() < 2 * kChunk) {
      divide(in.data(), in.data() + in.size(), split, left_cell, right_cell, left.references, right.references);
      return;
    }
    const std::size_t chunks = (in.size() + kChunk - 1) / kChunk;
    std::vector<References> l(chunks), r(chunks);
    tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t c) {
      divide(in.data() + c * kChunk, in.data() + std::min(in.size(), (c + 1) * kChunk), split, left_cell, right_cell, l[c], r[c]);
    });
    join(l, left.references), join(r, right.references);
  }

 private:
  static Bounds3f bounds_of(const References& references, bool parallel) {
    const auto over = [](const Reference* r, const Reference* end) {
      Bounds3f bounds;
      for (; r != end; ++r) bounds.extend(r->box);
      return bounds;
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
    for (; r != end; ++r) {
      for (std::size_t k = 0; k < 3; ++k) {
        ++bins.begins[k][map.begin(r->box.lower[k], k)];
        ++bins.ends[k][map.end(r->box.upper[k], k)];
      }
    }
  }

  static void add(Bins& into, const Bins& from, unsigned n) {
    for (std::size_t k = 0; k < 3; ++k) {
      for (unsigned b = 0; b < n; ++b) into.begins[k][b] += from.begins[k][b], into.ends[k][b] += from.ends[k][b];
    }
  }

  void divide(const Reference* r, const Reference* end, const Split& split, const Bounds3f& left_cell, const Bounds3f& right_cell,
              References& left, References& right) const {
    for (; r != end; ++r) {
      switch (side_of(r->box, split)) {
        case Side::left: left.push_back(*r); break;
        case Side::right: right.push_back(*r); break;
        case Side::both: {
          Bounds3f l, h;
          divide_reference(mesh_, *r, split, left_cell, right_cell, l, h);
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
  const CostModel& model_;
  const unsigned max_bins_;
};

}  // namespace

void build_binned(const TriangleMesh& mesh, const BuilderParameters& parameters, const CostModel& model, const Limits& limits,
                  const Bounds3f& cell, Part& out, BuildReport& report) {
  double start = wall_seconds();
  Binned::State root{make_references(mesh)};
  report.phases.emplace_back("references", wall_seconds() - start);
  start = wall_seconds();
  const Binned method(mesh, model, parameters.bins);
  TopDown<Binned>(method, model, limits).build(std::move(root), cell, out);
  report.phases.emplace_back("splits", wall_seconds() - start);
}

}  // namespace arboretum::kdtree
