#include "structures/kdtree/split.h"

#include <algorithm>

#include <tbb/parallel_for.h>

#include "structures/kdtree/builders.h"
#include "structures/kdtree/clip.h"

namespace arboretum::kdtree {
namespace {

/// `part` cut to `box`; false where nothing is left. Both are bounds of the same thing, so only rounding can part them.
[[nodiscard]] bool cut_to(Bounds3f& part, const Bounds3f& box) noexcept {
  part.lower = max(part.lower, box.lower), part.upper = min(part.upper, box.upper);
  return !part.empty();
}

}  // namespace

void divide_reference(const TriangleMesh& mesh, const BoxPads& pads, const Reference& reference, const Split& split,
                      const Bounds3f& cell, Bounds3f& left, Bounds3f& right) noexcept {
  const std::size_t axis = std::size_t(split.axis);
  Bounds3f left_half = reference.box, right_half = reference.box;
  left_half.upper[axis] = right_half.lower[axis] = split.plane;
  const std::array<Vec3f, 3> corners = mesh.corners(reference.id);
  const double pad = pads.any() ? pads.pad(largest_coordinate(mesh, {&reference.id, 1})) : 0.0;
  if (pad > 0.0) {
    const auto thick_part = [&](const Bounds3f& half) {
      return BoxPads::widened(clipped_bounds(corners, BoxPads::widened(half, pad)), pad);
    };
    left = thick_part(left_half), right = thick_part(right_half);
  } else {
    clipped_bounds(corners, cell, split.axis, split.plane, left, right);
  }
  const bool in_left = cut_to(left, left_half), in_right = cut_to(right, right_half);
  if (!in_left && !in_right) left = left_half, right = right_half;
}

References make_references(const TriangleMesh& mesh, const BoxPads& pads) {
  References references(mesh.size());
  tbb::parallel_for(std::size_t{0}, (mesh.size() + kChunk - 1) / kChunk, [&](std::size_t c) {
    for (std::size_t i = c * kChunk, end = std::min(mesh.size(), i + kChunk); i < end; ++i) {
      references[i] = {pads.widened(mesh.bounds(i)), std::uint32_t(i)};
    }
  });
  return references;
}

}  // namespace arboretum::kdtree
