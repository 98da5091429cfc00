#include "structures/grid/cell_counts.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace arboretum::grid {
namespace {

constexpr double kMostCellSize = std::numeric_limits<float>::max();  // no scene is wider than two such cells

/// Cells on each axis so that there are about `wanted` nearly cubic cells, none narrower than `least`.
Index3 choose_counts(const Extent& extent, double wanted, double least) {
  double low = 1e-60, high = 1e60;  // the cell's side: more cells than wanted, fewer
  for (int i = 0; i < 96; ++i) {
    const double side = std::sqrt(low * high);
    double cells = 1;
    for (double e : extent) cells *= std::max(1.0, e / side);
    (cells > wanted ? low : high) = side;
  }
  Index3 counts;
  for (std::size_t a = 0; a < 3; ++a) {
    const double fewest = extent[a] > kMostCellSize ? 2.0 : 1.0;
    const double most = std::clamp(std::floor(extent[a] / least), fewest, 65536.0);
    counts[a] = std::uint32_t(std::clamp(std::round(extent[a] / high), fewest, most));
  }
  return counts;
}

}  // namespace

void Sizes::add(const std::array<Vec3f, 3>& c, const Extent& most) {
  double e[2][3];
  for (std::size_t a = 0; a < 3; ++a) {
    e[0][a] = double(c[1][a]) - c[0][a], e[1][a] = double(c[2][a]) - c[0][a];
    const double w = double(std::max({c[0][a], c[1][a], c[2][a]})) - std::min({c[0][a], c[1][a], c[2][a]});
    width[a] += std::min(w, most[a]);
  }
  for (std::size_t a = 0; a < 3; ++a) {
    const std::size_t p = (a + 1) % 3, q = (a + 2) % 3;
    area[a] += std::min(0.5 * std::abs(e[0][p] * e[1][q] - e[0][q] * e[1][p]), most[p] * most[q]);
  }
  ++triangles;
}

void Sizes::add(const Sizes& s) {
  for (std::size_t a = 0; a < 3; ++a) width[a] += s.width[a], area[a] += s.area[a];
  triangles += s.triangles;
}

double Sizes::references(const Extent& extent, const Index3& counts) const {
  Extent cell;
  for (std::size_t a = 0; a < 3; ++a) cell[a] = extent[a] / counts[a];
  double sum = triangles;
  for (std::size_t a = 0; a < 3; ++a) {
    if (counts[a] > 1) sum += width[a] / cell[a];
    const std::size_t p = (a + 1) % 3, q = (a + 2) % 3;
    if (counts[p] > 1 && counts[q] > 1) sum += area[a] / (cell[p] * cell[q]);
  }
  return sum;
}

Index3 counts_within(const Sizes& sizes, const Extent& extent, double wanted, double least, double limit) {
  for (;; wanted *= 0.7) {
    const Index3 counts = choose_counts(extent, wanted, least);
    if (wanted <= 1.0 || sizes.references(extent, counts) <= limit) return counts;
  }
}

Level make_level(const Vec3f& lower, const Extent& extent, const Index3& counts) {
  Level level{};
  for (std::size_t a = 0; a < 3; ++a) {
    level.lower[a] = lower[a];
    float cell = float(extent[a] / counts[a]);
    while (double(cell) * counts[a] < extent[a]) cell = std::nextafter(cell, std::numeric_limits<float>::infinity());
    level.cell[a] = cell, level.inverse[a] = 1.0f / cell, level.last[a] = float(counts[a] - 1);
  }
  return level;
}

double wanted_cells(const BuilderParameters& parameters, double triangles, double share) {
  return std::min(double(parameters.grid_density) * triangles * share, kMostCells);
}

double expected_steps(const Level& level) {
  const double x = level.cell[0], y = level.cell[1], z = level.cell[2];
  const double nx = level.cells_on(0), ny = level.cells_on(1), nz = level.cells_on(2);
  const double whole = nx * x * ny * y + ny * y * nz * z + nz * z * nx * x;
  return whole > 0 ? double(level.size()) * (x * y + y * z + z * x) / whole : 1.0;
}

}  // namespace arboretum::grid
