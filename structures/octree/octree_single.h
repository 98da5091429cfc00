// One ray through the octree: closest hit front to back, any hit back to front, since what a shadow ray meets stands by
// its light more often than by its origin (docs/performance/other-structures.md).
//
// The eight children are tested at once. They are numbered as the ray meets them, number ^ octant of the
// direction: bit 0 of that number is 0 in the half that the ray enters first on x, so rising numbers are an
// order from near to far, and a child's near and far distances on an axis depend on that bit alone: (first
// face, middle) or (middle, last face).
#pragma once

#include "structures/octree/octree.h"
#include "traversal/box_rays.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Bits of `mask` moved from number c to c ^ octant.
ARBORETUM_INLINE unsigned permute_by_octant(unsigned mask, unsigned octant) {
  if (octant & 1) mask = (mask & 0x55u) << 1 | (mask & 0xaau) >> 1;
  if (octant & 2) mask = (mask & 0x33u) << 2 | (mask & 0xccu) >> 2;
  if (octant & 4) mask = (mask & 0x0fu) << 4 | (mask & 0xf0u) >> 4;
  return mask;
}

struct alignas(16) OctreeCell {
  std::int32_t at[4];  ///< its position at its level; lane 3 is 0
  octree::Node node;
  std::int32_t level;
};
/// Cells that wait at most, below one whose children are being pushed.
inline constexpr unsigned kMostOctreeCells = 7 * (octree::kMostLevels + 1) + 8;

/// The three planes of each axis that a cell's children have: its first face as rays of the octant meet them, the
/// middle, its last face.
struct OctreePlanes {
  using F = vf<4>;
  vi<4> twice;
  F in, middle, out;
  ARBORETUM_INLINE OctreePlanes(const octree::Cube& cube, const OctreeCell& cell, vm<4> negative)
      : twice(vi<4>::load(cell.at).template shift_left<1>()) {
    const F lower = F::load(cube.lower), size(cube.half / float(1u << cell.level));
    const F a = lower + to_float(twice) * size, b = lower + to_float(twice + vi<4>(2)) * size;
    middle = lower + to_float(twice + vi<4>(1)) * size;
    in = select(negative, b, a), out = select(negative, a, b);
  }
  /// Child `c`, which exists, of `cell`; `children` is the first of them.
  ARBORETUM_INLINE OctreeCell child(const OctreeCell& cell, const octree::Node* children, unsigned c) const {
    static constexpr std::int32_t kOffsets[8][4] = {{0, 0, 0, 0}, {1, 0, 0, 0}, {0, 1, 0, 0}, {1, 1, 0, 0},
                                                    {0, 0, 1, 0}, {1, 0, 1, 0}, {0, 1, 1, 0}, {1, 1, 1, 0}};
    OctreeCell to;
    (twice + vi<4>::load(kOffsets[c])).store(to.at);
    to.node = children[__builtin_popcount(cell.node.mask & ((1u << c) - 1u))], to.level = cell.level + 1;
    return to;
  }
};

/// A ray's constants (BoxRay), the axes in lanes.
struct OctreeRay {
  using F = vf<4>;
  F reciprocal, near_constant, far_constant;
  vm<4> negative;
  unsigned octant;

  ARBORETUM_INLINE OctreeRay(Vec3f r, Vec3f f, Vec3f g)
      : reciprocal(four(r.x, r.y, r.z, 0)), near_constant(four(f.x, f.y, f.z, 0)), far_constant(four(g.x, g.y, g.z, 0)),
        negative(reciprocal.as_int() < vi<4>(0)), octant(negative.bits() & 7u) {}
  template <bool Padded>
  ARBORETUM_INLINE explicit OctreeRay(const BoxRay<8, Padded>& box)
      : OctreeRay(box.r, box.near_offset, box.far_offset) {}
  ARBORETUM_INLINE F near(F face) const { return plane_distance(face, reciprocal, near_constant); }
  ARBORETUM_INLINE F far(F face) const { return plane_distance(face, reciprocal, far_constant); }
};

/// Takes one of the children `hit`, numbered as the ray meets them, out of them: the last one or the first.
template <bool Last>
ARBORETUM_INLINE unsigned take_child(unsigned& hit) {
  const auto number = unsigned(Last ? 31 - __builtin_clz(hit) : __builtin_ctz(hit));
  hit = Last ? hit ^ 1u << number : hit & (hit - 1);
  return number;
}

/// A cell and where the ray enters it.
struct OctreeEntry {
  OctreeCell cell;
  float t;
};

/// At the inner cell of `e`, between tnear and the nearest hit: of the children that the ray meets `e` becomes the
/// first, the others go to the stack, the last one first. Returns whether there are any.
template <bool AnyHit, class Counting>
ARBORETUM_INLINE bool step_octree(const octree::Octree& tree, const OctreeRay& box, OctreeEntry& e, float tnear,
                                  float nearest, OctreeEntry*& top, const Counting& counting) {
  using F = vf<8>;
  const vm<8> x = vm<8>::from_bits(0xaa), y = vm<8>::from_bits(0xcc), z = vm<8>::from_bits(0xf0);
  const OctreePlanes planes(tree.cube(), e.cell, box.negative);
  alignas(16) float in[4], middle_near[4], middle_far[4], out[4];
  box.near(planes.in).store(in), box.near(planes.middle).store(middle_near);
  box.far(planes.middle).store(middle_far), box.far(planes.out).store(out);
  const F entry = max_x86(max_x86(select(x, F(middle_near[0]), F(in[0])), select(y, F(middle_near[1]), F(in[1]))),
                          max_x86(select(z, F(middle_near[2]), F(in[2])), F(tnear)));
  const F exit = min_x86(min_x86(select(x, F(out[0]), F(middle_far[0])), select(y, F(out[1]), F(middle_far[1]))),
                         min_x86(select(z, F(out[2]), F(middle_far[2])), F(nearest)));
  unsigned hit = (entry <= exit).bits() & permute_by_octant(e.cell.node.mask, box.octant);
  if constexpr (Counting::kCounting)
    counting.node(unsigned(__builtin_popcount(e.cell.node.mask)), 8, unsigned(__builtin_popcount(hit)));
  if (hit == 0) return false;
  alignas(32) float t[8];
  entry.store(t);
  const octree::Node* const children = tree.nodes() + e.cell.node.first;
  const auto child = [&](unsigned number) {
    return OctreeEntry{planes.child(e.cell, children, number ^ box.octant), t[number]};
  };
  const unsigned first = take_child<AnyHit>(hit);
  while (hit) *top++ = child(take_child<!AnyHit>(hit));
  e = child(first);
  return true;
}

/// The next that waits into `e`, or false; `nearest`: beyond it nothing is visited.
template <bool AnyHit>
ARBORETUM_INLINE bool pop_octree(OctreeEntry*& top, const OctreeEntry* stack, OctreeEntry& e, float nearest) {
  do {
    if (top == stack) return false;
    e = *--top;
  } while (!AnyHit && e.t > nearest);
  return true;
}

/// What lies in the cell `start`, which the ray is taken to enter. visits(code) is called for leaves and ends the
/// search where it is true; `last` is the leaf that the ray comes from, since neighbouring cells may share one.
template <bool AnyHit, class Counting, class Visits>
ARBORETUM_INLINE bool search_octree(const octree::Octree& tree, const OctreeRay& box, const OctreeCell& start,
                                    float tnear, NearestHit& best, LeafCode& last, const Counting& counting,
                                    Visits& visits) {
  OctreeEntry stack[kMostOctreeCells];
  OctreeEntry* top = stack;
  OctreeEntry e{start, 0.0f};
  for (;;) {
    if (e.cell.node.mask != 0) {
      if (step_octree<AnyHit>(tree, box, e, tnear, best.t, top, counting)) continue;
    } else if (e.cell.node.first != last) {
      last = e.cell.node.first;
      if (visits(last)) return true;
    }
    if (!pop_octree<AnyHit>(top, stack, e, best.t)) return false;
  }
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
