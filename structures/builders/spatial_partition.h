// Partition of references by a plane in space: those that lie on both sides are clipped, or given to one side alone.
#pragma once

#include "structures/builders/clip.h"
#include "structures/builders/spatial_bins.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {
namespace sah {

/// What a partition made.
struct Sides {
  std::size_t left_count, right_count;
  Bounds left, right;
  static Sides none() { return {0, 0, Bounds::none(), Bounds::none()}; }
};

/// Tells where references go, by the bins that the split was chosen with.
class SpatialSorter {
 public:
  SpatialSorter(const TriangleMesh& mesh, const SpatialMap& map, const SpatialSplit& split)
      : mesh_(mesh), map_(map, split.axis), split_(split), plane_(map_.plane(split.bin)),
        left_area_(half_area_or_0(split.left)), right_area_(half_area_or_0(split.right)) {}

  /// Calls left(reference), right(reference) or both.
  template <class Left, class Right>
  ARBORETUM_INLINE void operator()(const Reference& r, const Left& left, const Right& right) const {
    const int axis = split_.axis;
    if (map_(r.upper[axis]) < split_.bin) return left(r);
    if (map_(-r.neg_lower[axis]) >= split_.bin) return right(r);
    // Unsplitting, the paper's section 4.4, with the boxes that splitting every such reference would give.
    const Box box = Box::load(&r);
    const float nl = float(split_.left_count), nr = float(split_.right_count);
    const float both_cost = left_area_ * nl + right_area_ * nr;
    const float left_cost = half_area_or_0(max_x86(box, split_.left)) * nl + right_area_ * (nr - 1.0f);
    const float right_cost = left_area_ * (nl - 1.0f) + half_area_or_0(max_x86(box, split_.right)) * nr;
    if (left_cost < both_cost && left_cost <= right_cost) return left(r);
    if (right_cost < both_cost) return right(r);
    // The plane may round to either end of the reference.
    const float lower = -r.neg_lower[axis], upper = r.upper[axis], plane = std::min(std::max(plane_, lower), upper);
    const std::array<Vec3f, 3> corners = mesh_.corners(r.id);
    Reference low, high;
    const bool has_low = cut(r, clip_to_slab(corners, axis, lower, plane), low);
    const bool has_high = cut(r, clip_to_slab(corners, axis, plane, upper), high);
    if (!has_low && !has_high) return left(r);
    if (has_low) left(low);
    if (has_high) right(high);
  }

 private:
  /// The reference within a box; false where nothing is left.
  static bool cut(const Reference& r, const Bounds3f& box, Reference& out) {
    bool some = true;
    for (int axis = 0; axis < 3; ++axis) {
      out.neg_lower[axis] = std::min(r.neg_lower[axis], -box.lower[axis]);
      out.upper[axis] = std::min(r.upper[axis], box.upper[axis]);
      some &= -out.neg_lower[axis] <= out.upper[axis];
    }
    out.id = r.id, out.zero = 0.0f;
    return some;
  }

  const TriangleMesh& mesh_;
  const SpatialAxis map_;
  const SpatialSplit& split_;
  const float plane_, left_area_, right_area_;
};

/// Writes the left side's references from `left_out` on and the right side's from `right_end` back.
inline Sides spatial_partition(const Reference* r, const Reference* end, const SpatialSorter& sorter,
                               Reference* left_out, Reference* right_end) {
  Sides sides = Sides::none();
  Reference *l = left_out, *h = right_end;
  for (; r < end; ++r) {
    sorter(
        *r, [&](const Reference& ref) { *l++ = ref, sides.left.extend(ref); },
        [&](const Reference& ref) { *--h = ref, sides.right.extend(ref); });
  }
  sides.left_count = std::size_t(l - left_out), sides.right_count = std::size_t(right_end - h);
  return sides;
}

/// The same, in parallel for many references: a first pass counts.
inline Sides spatial_partition_range(const TriangleMesh& mesh, const Reference* r, const Reference* end,
                                     const SpatialMap& map, const SpatialSplit& split, Reference* left_out,
                                     Reference* right_end) {
  const SpatialSorter sorter(mesh, map, split);
  const std::size_t n = std::size_t(end - r);
  if (n <= kLarge) return spatial_partition(r, end, sorter, left_out, right_end);
  struct Chunk {
    std::size_t left_begin, right_begin;
    Sides sides;
  };
  MeteredVector<Chunk> chunks((n + kChunk - 1) / kChunk);
  tbb::parallel_for(std::size_t{0}, chunks.size(), [&](std::size_t c) {
    std::size_t left = 0, right = 0;
    for (const Reference *at = r + c * kChunk, *stop = std::min(end, at + kChunk); at < stop; ++at) {
      sorter(
          *at, [&](const Reference&) { ++left; }, [&](const Reference&) { ++right; });
    }
    chunks[c].left_begin = left, chunks[c].right_begin = right;
  });
  Sides all = Sides::none();
  for (Chunk& c : chunks) {
    all.left_count += std::exchange(c.left_begin, all.left_count),
        all.right_count += std::exchange(c.right_begin, all.right_count);
  }
  tbb::parallel_for(std::size_t{0}, chunks.size(), [&](std::size_t c) {
    const Reference* at = r + c * kChunk;
    chunks[c].sides = spatial_partition(at, std::min(end, at + kChunk), sorter, left_out + chunks[c].left_begin,
                                        right_end - chunks[c].right_begin);
  });
  for (const Chunk& c : chunks) all.left.extend(c.sides.left), all.right.extend(c.sides.right);
  return all;
}

}  // namespace sah
}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
