#include "structures/grid/grid_builder.h"

#include <algorithm>
#include <atomic>
#include <limits>

#include <tbb/parallel_for.h>

#include "core/coordinates.h"
#include "core/error.h"
#include "structures/builders/phase_clock.h"
#include "structures/grid/cell_counts.h"
#include "structures/grid/cell_ranges.h"

namespace arboretum::grid {
namespace {

constexpr std::size_t kChunk = 4096;
constexpr std::uint64_t kMostInLists = 0xfffffff0u;
constexpr std::uint64_t kFewestCells = 8;  ///< that no coarser grid goes below, two on each axis

/// f(chunk number, begin, end) for chunks of fixed size: what each gives does not depend on the number of
/// threads.
template <class F>
void for_each_chunk(std::size_t size, std::size_t chunk, F&& f) {
  tbb::parallel_for(std::size_t(0), (size + chunk - 1) / chunk,
                    [&](std::size_t k) { f(k, k * chunk, std::min(size, (k + 1) * chunk)); });
}

Sizes sum_sizes(const TriangleMesh& mesh, const Extent& extent) {
  std::vector<Sizes> parts((mesh.size() + kChunk - 1) / kChunk);
  for_each_chunk(mesh.size(), kChunk, [&](std::size_t k, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) parts[k].add(mesh.corners(i), extent);
  });
  Sizes sum;
  for (const Sizes& s : parts) sum.add(s);
  return sum;
}

/// Counts, then places each triangle in its cells; each cell's list ends up in rising order. False where
/// there would be more than `limit` references.
bool fill_lists(const TriangleMesh& mesh, const Level& level, double pad, std::uint64_t limit, LeafLists& lists) {
  const CellGeometry geometry(level, pad);
  const std::size_t cells = level.size();
  MeteredVector<std::uint32_t> cursor(cells);
  tbb::parallel_for(std::size_t(0), (cells + kChunk - 1) / kChunk, [&](std::size_t k) {
    std::fill(cursor.begin() + std::ptrdiff_t(k * kChunk),
              cursor.begin() + std::ptrdiff_t(std::min(cells, (k + 1) * kChunk)), 0u);
  });
  std::atomic<std::uint64_t> total{0};
  for_each_chunk(mesh.size(), kChunk, [&](std::size_t, std::size_t begin, std::size_t end) {
    std::uint64_t count = 0;
    for (std::size_t i = begin; i < end; ++i) {
      if (total.load(std::memory_order_relaxed) > limit) return;
      geometry.for_each_touched(mesh.corners(i), [&](std::uint32_t cell) {
        std::atomic_ref(cursor[cell]).fetch_add(1, std::memory_order_relaxed), ++count;
      });
    }
    total.fetch_add(count, std::memory_order_relaxed);
  });
  if (total > limit) return false;
  lists.begin.resize(cells + 1);
  std::uint32_t sum = 0;
  for (std::size_t c = 0; c < cells; ++c) {
    lists.begin[c] = sum, sum += cursor[c], cursor[c] = lists.begin[c];
  }
  lists.begin[cells] = sum;
  lists.ids.resize(sum);
  for_each_chunk(mesh.size(), kChunk, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      geometry.for_each_touched(mesh.corners(i), [&](std::uint32_t cell) {
        lists.ids[std::atomic_ref(cursor[cell]).fetch_add(1, std::memory_order_relaxed)] = std::uint32_t(i);
      });
    }
  });
  for_each_chunk(cells, kChunk, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t c = begin; c < end; ++c)
      std::sort(lists.ids.begin() + lists.begin[c], lists.ids.begin() + lists.begin[c + 1]);
  });
  return true;
}

/// The inner grids of a run of outer cells.
struct InnerGrids {
  struct Owner {
    std::uint32_t cell;  ///< of the outer grid
    Level level;
  };
  std::vector<Owner> owners;
  MeteredVector<std::uint32_t> counts;  ///< a cell's references
  MeteredVector<std::uint32_t> ids;
};

class InnerBuilder {
 public:
  InnerBuilder(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, double pad,
               const Level& outer)
      : mesh_(mesh), parameters_(parameters), width_(leaf_width), pad_(pad), outer_(outer) {}

  /// Gives the cell a grid of its own where that is expected to cost less than its blocks.
  void consider(std::uint32_t cell, std::span<const std::uint32_t> ids, InnerGrids& out) {
    const double leaf_cost = double((ids.size() + width_ - 1) / width_) * parameters_.intersection_cost;
    if (leaf_cost <= 2.0 * parameters_.traversal_cost) return;
    Extent extent;
    Vec3f lower;
    std::uint32_t at = cell;
    for (std::size_t a = 0; a < 3; ++a) {
      const std::uint32_t i = at % outer_.cells_on(int(a));
      at /= outer_.cells_on(int(a));
      lower[a] = face(outer_, a, i), extent[a] = outer_.cell[a];
    }
    Sizes sizes;
    for (std::uint32_t id : ids) sizes.add(mesh_.corners(id), extent);
    const std::uint64_t limit = std::uint64_t(kInnerReferences) * ids.size();
    double wanted = wanted_cells(parameters_, double(ids.size()));
    for (;; wanted *= 0.5) {
      const Index3 counts = counts_within(sizes, extent, wanted, 2 * pad_, double(limit));
      const std::uint32_t cells = counts[0] * counts[1] * counts[2];
      if (cells < 4) return;
      const Level level = make_level(lower, extent, counts);
      if (!place(level, ids, limit)) continue;
      double blocks = 0;
      for (std::uint32_t c = 0; c < cells; ++c) blocks += double((counts_[c] + width_ - 1) / width_);
      const double cost = parameters_.traversal_cost * (1.0 + expected_steps(level)) +
                          parameters_.intersection_cost * blocks * expected_steps(level) / cells;
      if (cost >= leaf_cost) return;
      return keep(cell, level, out);
    }
  }

 private:
  bool place(const Level& level, std::span<const std::uint32_t> ids, std::uint64_t limit) {
    const CellGeometry geometry(level, pad_);
    counts_.assign(level.size(), 0);
    pairs_.clear();
    for (std::uint32_t id : ids) {
      geometry.for_each_touched(mesh_.corners(id), [&](std::uint32_t cell) {
        pairs_.push_back({cell, id}), ++counts_[cell];
      });
      if (pairs_.size() > limit) return false;
    }
    return true;
  }

  void keep(std::uint32_t cell, const Level& level, InnerGrids& out) {
    out.owners.push_back({cell, level});
    const std::size_t base = out.ids.size();
    out.ids.resize(base + pairs_.size());
    out.counts.insert(out.counts.end(), counts_.begin(), counts_.end());
    std::size_t sum = base;
    for (std::uint32_t& c : counts_) {
      const std::uint32_t count = c;
      c = std::uint32_t(sum - base), sum += count;
    }
    for (const auto& [c, id] : pairs_) out.ids[base + counts_[c]++] = id;
  }

  const TriangleMesh& mesh_;
  const BuilderParameters& parameters_;
  unsigned width_;
  double pad_;
  const Level& outer_;
  std::vector<std::uint32_t> counts_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs_;
};

/// Replaces the lists of crowded cells by inner grids.
void add_inner_grids(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, Cells& cells) {
  constexpr std::size_t kCells = 256;
  const std::size_t outer = cells.lists.size();
  std::vector<InnerGrids> parts((outer + kCells - 1) / kCells);
  for_each_chunk(outer, kCells, [&](std::size_t k, std::size_t begin, std::size_t end) {
    InnerBuilder builder(mesh, parameters, leaf_width, cells.pad, cells.levels[0]);
    for (std::size_t c = begin; c < end; ++c) builder.consider(std::uint32_t(c), cells.lists[c], parts[k]);
  });
  struct Place {
    std::uint64_t level, cell, id;  ///< where the part's first goes
  };
  std::vector<Place> places(parts.size() + 1);
  std::uint64_t kept = 0;  // references of outer cells that stay leaves
  for (std::size_t k = 0; k < parts.size(); ++k) {
    places[k + 1] = {places[k].level + parts[k].owners.size(), places[k].cell + parts[k].counts.size(),
                     places[k].id + parts[k].ids.size()};
    for (const auto& owner : parts[k].owners) {
      cells.codes[owner.cell] =
          LeafCode(places[k].level + 1 + std::uint64_t(&owner - parts[k].owners.data())) << kLeafShift | kNoLeaf;
    }
  }
  for (std::size_t c = 0; c < outer; ++c) kept += cells.codes[c] == kEmptyLeaf ? cells.lists[c].size() : 0;
  const std::uint64_t all_cells = outer + places.back().cell, all_ids = kept + places.back().id;
  if (all_cells > kMostInLists || all_ids > kMostInLists || places.back().level >= (1u << 28)) {
    throw UserError("grid: " + std::to_string(all_cells) + " cells and " + std::to_string(all_ids) +
                    " references pass 2^32: use a smaller grid_density");
  }
  LeafLists lists;
  lists.begin.resize(all_cells + 1), lists.ids.resize(all_ids);
  std::uint32_t next = 0;
  for (std::size_t c = 0; c < outer; ++c) {
    lists.begin[c] = next;
    if (cells.codes[c] != kEmptyLeaf) continue;
    const auto from = cells.lists[c];
    std::copy(from.begin(), from.end(), lists.ids.begin() + next);
    next += std::uint32_t(from.size());
  }
  lists.begin[all_cells] = std::uint32_t(all_ids);
  cells.levels.resize(1 + places.back().level);
  cells.codes.resize(all_cells, kEmptyLeaf);
  tbb::parallel_for(std::size_t(0), parts.size(), [&](std::size_t k) {
    std::uint64_t cell = outer + places[k].cell;
    for (std::size_t g = 0; g < parts[k].owners.size(); ++g) {
      Level level = parts[k].owners[g].level;
      level.first = std::uint32_t(cell), cell += level.size();
      cells.levels[1 + places[k].level + g] = level;
    }
    std::uint64_t id = kept + places[k].id;
    std::copy(parts[k].ids.begin(), parts[k].ids.end(), lists.ids.begin() + std::ptrdiff_t(id));
    for (std::size_t c = 0; c < parts[k].counts.size(); ++c) {
      lists.begin[outer + places[k].cell + c] = std::uint32_t(id), id += parts[k].counts[c];
    }
    parts[k] = {};
  });
  cells.lists = std::move(lists);
}

}  // namespace

void build_cells(const TriangleMesh& mesh, const BuilderParameters& parameters, bool two_level, unsigned leaf_width,
                 Cells& cells, BuildReport& report) {
  PhaseClock phase(report);
  const Bounds3f bounds = mesh.bounds();
  const double largest = largest_coordinate(bounds);
  double reach = 0;
  for (std::size_t a = 0; a < 3; ++a) reach = std::max(reach, double(bounds.upper[a]) - bounds.lower[a]);
  reach = std::max(reach, largest / 64);
  constexpr double finite = std::numeric_limits<float>::max();
  cells.max_coordinate = float(largest), cells.reach = float(std::min(reach, finite));
  cells.pad = std::max(float(0x1p-20 * largest + 0x1p-16 * reach), 0x1p-100f);
  const double pad = cells.pad;
  Extent extent;
  Vec3f lower;
  for (std::size_t a = 0; a < 3; ++a) {
    lower[a] = float(std::max(bounds.lower[a] - pad, -finite));
    extent[a] = std::min(bounds.upper[a] + pad, finite) - lower[a];
  }
  const Sizes sizes = sum_sizes(mesh, extent);
  const double n = double(mesh.size());
  const std::uint64_t limit = std::min<std::uint64_t>(
      std::uint64_t(two_level ? kOuterReferences : kMostReferences) * mesh.size(), kMostInLists);
  // The outer grid of two has cells for inner ones to refine; alone it has all of them.
  double wanted = std::max(1.0, wanted_cells(parameters, n, two_level ? kOuterShare : 1.0));
  for (;; wanted *= 0.5) {
    const Index3 counts = counts_within(sizes, extent, wanted, 2 * pad, double(limit));
    cells.levels.assign(1, make_level(lower, extent, counts));
    // A scene wider than floats go has eight cells at least, and the coarsest level is taken as it is.
    const bool coarsest = wanted <= 1.0;
    const std::uint64_t most = coarsest ? std::min(std::max(limit, kFewestCells * mesh.size()), kMostInLists) : limit;
    if (fill_lists(mesh, cells.levels[0], pad, most, cells.lists)) break;
    if (coarsest) throw UserError("grid: the references of the fewest cells that can be pass 2^32: take a bvh8");
  }
  cells.codes.assign(cells.levels[0].size(), kEmptyLeaf);
  phase.ends("outer_grid");
  if (two_level) {
    add_inner_grids(mesh, parameters, leaf_width, cells);
    phase.ends("inner_grids");
  }
}

}  // namespace arboretum::grid
