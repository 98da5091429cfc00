// What the two kd-tree builders share: references, the cost model, the rule by which a plane parts references.
#pragma once

#include <cstdint>
#include <limits>

#include "core/bounds.h"
#include "core/memory_meter.h"
#include "core/mesh.h"
#include "structures/accel.h"
#include "structures/box_pads.h"

namespace arboretum::kdtree {

/// A triangle's part in a cell: the bounds of that part and the triangle's id. A triangle has one reference in a cell
/// at most.
struct Reference {
  Bounds3f box;
  std::uint32_t id;
};
static_assert(sizeof(Reference) == 28);  // four floats can be read from lower and from upper
using References = MeteredVector<Reference>;

/// A plane, what it costs relative to testing nothing, and where references that lie flat in it go.
struct Split {
  double cost = std::numeric_limits<double>::infinity();
  float plane = 0.0f;
  int axis = -1;
  bool flat_left = true;
  [[nodiscard]] bool exists() const noexcept { return axis >= 0; }
};

[[nodiscard]] inline Bounds3f left_of(Bounds3f cell, const Split& split) noexcept {
  cell.upper[std::size_t(split.axis)] = split.plane;
  return cell;
}
[[nodiscard]] inline Bounds3f right_of(Bounds3f cell, const Split& split) noexcept {
  cell.lower[std::size_t(split.axis)] = split.plane;
  return cell;
}

enum class Side : std::uint8_t { left, right, both };

/// Where a box goes: a plane that only touches it does not cut it. The box is not empty.
[[nodiscard]] inline Side side_of(const Bounds3f& box, const Split& split) noexcept {
  const float low = box.lower[std::size_t(split.axis)], high = box.upper[std::size_t(split.axis)];
  if (low < split.plane) return high > split.plane ? Side::both : Side::left;
  if (high > split.plane) return Side::right;
  return split.flat_left ? Side::left : Side::right;
}

/// Parts a reference of a cell that the plane cuts. A side that the triangle does not reach gets an empty box, but
/// never both of them: where rounding says so, both keep the reference's own box, cut at the plane. A triangle that is
/// thicker by `pads` reaches so much further.
void divide_reference(const TriangleMesh& mesh, const BoxPads& pads, const Reference& reference, const Split& split,
                      const Bounds3f& cell, Bounds3f& left, Bounds3f& right) noexcept;

inline constexpr std::size_t kChunk = 1u << 13;  ///< references that a task takes at a time, within one cell

/// Surface area heuristic (Wald and Havran 2006, section 2.2) for leaves of blocks: n references take n / width block
/// tests, one at least. Costs are in block tests; a step through a plane is a fixed part of a box node's.
struct CostModel {
  double step, block, keep;  ///< keep: factor for a split that leaves one side empty
  double per_block;          ///< 1 / width
  /// triangles in a block; references above which planes are tried even where they seem not to pay
  unsigned width, max_leaf;

  CostModel(const BuilderParameters& p, unsigned leaf_width) noexcept
      : step(p.traversal_cost), block(p.intersection_cost), keep(1.0 - p.empty_bonus), per_block(1.0 / leaf_width),
        width(leaf_width), max_leaf(p.max_leaf_blocks * leaf_width) {}

  [[nodiscard]] double leaf(std::size_t n) const noexcept { return block * double((n + width - 1) / width); }
  [[nodiscard]] double blocks(std::size_t n) const noexcept {
    const double b = double(n) * per_block;
    return n == 0 ? 0.0 : b < 1.0 ? 1.0 : b;
  }
};

/// Evaluates planes across one axis of a cell.
class AxisCost {
 public:
  AxisCost(const CostModel& model, const Bounds3f& cell, int axis) noexcept : model_(model), axis_(axis) {
    const std::size_t k = std::size_t(axis), i = (k + 1) % 3, j = (k + 2) % 3;
    low_ = cell.lower[k], high_ = cell.upper[k];
    const double di = double(cell.upper[i]) - cell.lower[i], dj = double(cell.upper[j]) - cell.lower[j];
    face_ = di * dj, rim_ = di + dj;
    const double area = face_ + rim_ * (high_ - low_);
    inverse_ = area > 0 ? 1.0 / area : 0.0;
    flat_ = !(area > 0) || !(low_ < high_);
  }
  /// No plane lies within the cell, or the cell has no area: there is nothing to gain.
  [[nodiscard]] bool flat() const noexcept { return flat_; }

  /// Chances of a ray in the cell to come to the plane's sides.
  [[nodiscard]] double share_left(double plane) const noexcept { return (face_ + rim_ * (plane - low_)) * inverse_; }
  [[nodiscard]] double share_right(double plane) const noexcept { return (face_ + rim_ * (high_ - plane)) * inverse_; }

  /// Takes the plane into `best` if it lies inside the cell and costs less, `left` and `right` references being on its
  /// sides.
  void consider(float plane, std::size_t left, std::size_t right, bool flat_left, Split& best) const noexcept {
    if (!(plane > low_ && plane < high_)) return;
    double cost = share_left(plane) * model_.blocks(left) + share_right(plane) * model_.blocks(right);
    cost = model_.step + model_.block * cost * (left == 0 || right == 0 ? model_.keep : 1.0);
    if (cost < best.cost) best = {cost, plane, axis_, flat_left};
  }

 private:
  const CostModel& model_;
  int axis_;
  double low_, high_, face_, rim_, inverse_;
  bool flat_;
};

}  // namespace arboretum::kdtree
