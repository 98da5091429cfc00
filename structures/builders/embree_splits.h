// EmbreeSplits: the parts of triangles that Embree's spatial-split builder asks for, such that it makes no child
// without a reference, where it may not go on (with assertions on, as Debian builds it, it ends the process): but for
// rare sets (docs/structures.md).
//
// Embree cuts a set twice. First it cuts every reference at all planes between the bins, counts on which sides of each
// plane there are parts, and chooses a plane; then it cuts at that plane what has something on both sides of it, as
// long as there is room for so many more references as it counted, and sorts by the bins of the centres. Two things
// lead it astray:
//  - A part with lower > upper on one axis alone, which boxes of parts within boxes of parts come to: Embree takes it
//    for empty and moves the reference's first bin up, also where there were parts in bins before; and extends boxes by
//    it. So both parts have a box here, flat if need be, whenever the plane is within the reference's box.
//  - A reference that is beyond the plane by less than the rounding of bins: counted on one side, cut for all that, it
//    takes another's room; or its thin part is counted, and sorted to the other side. So what was not cut at a plane
//    when parts were counted is not cut there, and nothing is cut next to its end.
#pragma once

#include <atomic>
#include <cstdint>

#include "core/bounds.h"
#include "core/memory_meter.h"
#include "core/mesh.h"

namespace arboretum {

class EmbreeSplits {
 public:
  /// Of a mesh that is not empty and outlives this.
  explicit EmbreeSplits(const TriangleMesh& mesh);

  /// What of the part of triangle `id` in `box` lies on either side of a plane across an axis: the triangle clipped to
  /// the side, within the box, as Embree clips its own triangles; or one empty box, for a reference that is to be left
  /// whole. `counts`: parts are being counted, not made. For any number of threads.
  void split(std::uint32_t id, const Bounds3f& box, int axis, float plane, bool counts, Bounds3f& low, Bounds3f& high);

 private:
  /// Where `counts`, it is from now on.
  [[nodiscard]] bool is_counted(std::uint64_t bit, bool counts) noexcept;
  [[nodiscard]] std::uint64_t bit_of(std::uint32_t id, const Bounds3f& box, int axis, float plane) const noexcept;

  const TriangleMesh& mesh_;
  Vec3f thin_;  ///< on each axis: of a thicker part no rounding hides on which side it is
  MeteredVector<std::atomic<std::uint64_t>> counted_;  ///< bits of cuts that leave something thin; two may share one
};

}  // namespace arboretum
