#include "structures/leaf_count_variability.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

#include "core/random.h"

namespace arboretum {
namespace {

constexpr std::uint64_t kSeed = 0x1eafc047;
constexpr std::size_t kMostLines = 4096, kBatch = 128;

struct Line {
  std::array<double, 3> origin, reciprocal;

  /// Both ways: no interval bounds it. A line within a face's plane counts as meeting it.
  [[nodiscard]] bool meets(const Bounds3f& box) const {
    double enter = -std::numeric_limits<double>::infinity(), leave = -enter;
    for (std::size_t k = 0; k < 3; ++k) {
      const double a = (double(box.lower[k]) - origin[k]) * reciprocal[k],
                   b = (double(box.upper[k]) - origin[k]) * reciprocal[k];
      enter = std::max(enter, std::min(a, b)), leave = std::min(leave, std::max(a, b));
    }
    return enter <= leave;
  }
};

Line random_line(const Bounds3f& box, std::uint64_t index) {
  const auto number = [&](std::uint64_t dimension) { return random_double(kSeed, index, dimension); };
  std::array<double, 3> size;
  for (std::size_t k = 0; k < 3; ++k) size[k] = double(box.upper[k]) - box.lower[k];
  const std::array<double, 3> face{size[1] * size[2], size[2] * size[0], size[0] * size[1]};
  double pick = number(0) * (face[0] + face[1] + face[2]);
  std::size_t axis = 0;
  while (axis < 2 && pick >= face[axis]) pick -= face[axis++];
  const bool upper = number(1) < 0.5;
  Line line;
  for (std::size_t k = 0; k < 3; ++k) line.origin[k] = double(box.lower[k]) + number(2 + k) * size[k];
  line.origin[axis] = upper ? box.upper[axis] : box.lower[axis];
  // A direction of density cos/pi about the face's normal; a component of 0 has probability 0 but is kept off division.
  const double radius = std::sqrt(number(5)), angle = 2 * 3.14159265358979323846 * number(6);
  std::array<double, 3> direction;
  direction[axis] = std::sqrt(std::max(0.0, 1.0 - radius * radius));
  direction[(axis + 1) % 3] = radius * std::cos(angle), direction[(axis + 2) % 3] = radius * std::sin(angle);
  for (std::size_t k = 0; k < 3; ++k)
    line.reciprocal[k] = 1.0 / (std::abs(direction[k]) < 1e-30 ? 1e-30 : direction[k]);
  return line;
}

}  // namespace

LeafCounts leaf_counts(std::span<const TreeRecord> records, double work) {
  LeafCounts result;
  if (records.empty()) return result;
  const Bounds3f& root = records.front().bounds;
  if (!(root.area() > 0.0)) {
    for (const TreeRecord& record : records) result.mean += record.is_leaf;
    return result;
  }
  double sum = 0.0, squares = 0.0, steps = 0.0;
  while (result.lines < kMostLines && steps < work) {
    std::array<std::size_t, kBatch> leaves{}, tests{};
    tbb::parallel_for(std::size_t{0}, kBatch, [&](std::size_t i) {
      const Line line = random_line(root, result.lines + i);
      // The first box is the root's: the line was made to meet it.
      for (std::size_t at = 0; at < records.size(); ++tests[i]) {
        const TreeRecord& record = records[at];
        const bool met = at == 0 || line.meets(record.bounds);
        leaves[i] += met && record.is_leaf;
        at = met ? at + 1 : record.end;
      }
    });
    for (std::size_t i = 0; i < kBatch; ++i) {
      const auto count = static_cast<double>(leaves[i]);
      sum += count, squares += count * count, steps += static_cast<double>(tests[i]);
    }
    result.lines += kBatch;
  }
  const auto n = static_cast<double>(result.lines);
  result.mean = sum / n;
  result.deviation = std::sqrt(std::max(0.0, squares / n - result.mean * result.mean));
  return result;
}

}  // namespace arboretum
