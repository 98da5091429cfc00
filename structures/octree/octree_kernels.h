// The kernels of the octree: one ray, closest hit and any hit.
//
// The eight children are tested at once. They are numbered as the ray meets them, number ^ octant of the
// direction: bit 0 of that number is 0 in the half that the ray enters first on x, so rising numbers are an
// order from near to far, and a child's near and far distances on an axis depend on that bit alone: (first
// face, middle) or (middle, last face).
#pragma once

#include "structures/leaves/leaf_kernels.h"
#include "traversal/box_test.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Bits of `mask` moved from number c to c ^ octant.
ARBORETUM_INLINE unsigned permute_by_octant(unsigned mask, unsigned octant) {
  if (octant & 1) mask = (mask & 0x55u) << 1 | (mask & 0xaau) >> 1;
  if (octant & 2) mask = (mask & 0x33u) << 2 | (mask & 0xccu) >> 2;
  if (octant & 4) mask = (mask & 0x0fu) << 4 | (mask & 0xf0u) >> 4;
  return mask;
}

template <bool Padded>
struct OctreeRay {
  using F = vf<4>;
  F reciprocal, near_constant, far_constant;
  vm<4> negative;
  unsigned octant;

  ARBORETUM_INLINE OctreeRay(const Ray& ray, float max_coordinate)
      : reciprocal(0.0f), near_constant(0.0f), far_constant(0.0f), negative(false), octant(0) {
    const BoxRay<8, Padded> box(ray, max_coordinate);
    const float r[4] = {box.r.x, box.r.y, box.r.z, 0}, f[4] = {box.f.x, box.f.y, box.f.z, 0},
                g[4] = {box.g.x, box.g.y, box.g.z, 0};
    reciprocal = F::load(r), near_constant = F::load(f), far_constant = F::load(g);
    negative = reciprocal.as_int() < vi<4>(0);
    octant = negative.bits() & 7u;
  }
  ARBORETUM_INLINE F near(F face) const {
    return kHasFma ? msub(face, reciprocal, near_constant) : (face - near_constant) * reciprocal;
  }
  ARBORETUM_INLINE F far(F face) const {
    return kHasFma ? msub(face, reciprocal, far_constant) : (face - far_constant) * reciprocal;
  }
};

template <bool Padded, class Counting>
struct OctreeSingle {
  using Scratch = NoScratch;
  struct alignas(16) Entry {
    std::int32_t at[4];  ///< the cell's position at its level; lane 3 is 0
    octree::Node node;
    std::int32_t level;
    float t;
  };
  static constexpr unsigned kStack = 7 * (octree::kMostLevels + 1) + 1;

  template <bool AnyHit, class Visits>
  static ARBORETUM_INLINE bool trace(const octree::Octree& tree, const Ray& ray, NearestHit& best,
                                     const Counting& counting, Scratch&, Visits& visits) {
    using F4 = vf<4>;
    using F = vf<8>;
    const OctreeRay<Padded> box(ray, tree.max_coordinate());
    const octree::Node* const nodes = tree.nodes();
    const F4 lower = F4::load(tree.cube().lower);
    const float side = tree.cube().side;
    const F tnear(ray.tnear);
    const vm<8> x = vm<8>::from_bits(0xaa), y = vm<8>::from_bits(0xcc), z = vm<8>::from_bits(0xf0);
    Entry stack[kStack];
    Entry* top = stack;
    LeafCode last = kEmptyLeaf;
    Entry e{{0, 0, 0, 0}, nodes[0], 0, 0.0f};
    for (;;) {
      if (e.node.mask == 0) {
        if (e.node.first != last) {
          last = e.node.first;
          if (visits(last)) return true;
        }
      } else {
        const vi<4> twice = vi<4>::load(e.at).template shift_left<1>();
        const F4 size(side / float(2u << e.level));
        const F4 a = lower + to_float(twice) * size, m = lower + to_float(twice + vi<4>(1)) * size,
                 b = lower + to_float(twice + vi<4>(2)) * size;
        alignas(16) float in[4], middle_near[4], middle_far[4], out[4];
        box.near(select(box.negative, b, a)).store(in), box.near(m).store(middle_near);
        box.far(m).store(middle_far), box.far(select(box.negative, a, b)).store(out);
        const F entry =
            max_x86(max_x86(select(x, F(middle_near[0]), F(in[0])), select(y, F(middle_near[1]), F(in[1]))),
                    max_x86(select(z, F(middle_near[2]), F(in[2])), tnear));
        const F exit =
            min_x86(min_x86(select(x, F(out[0]), F(middle_far[0])), select(y, F(out[1]), F(middle_far[1]))),
                    min_x86(select(z, F(out[2]), F(middle_far[2])), F(best.t)));
        unsigned hit = (entry <= exit).bits() & permute_by_octant(e.node.mask, box.octant);
        if constexpr (Counting::kCounting) counting.node(unsigned(__builtin_popcount(e.node.mask)), 8, unsigned(__builtin_popcount(hit)));
        if (hit != 0) {
          alignas(32) float t[8];
          entry.store(t);
          const octree::Node* const children = nodes + e.node.first;
          const unsigned mask = e.node.mask;
          const std::int32_t level = e.level + 1;
          const auto child = [&](unsigned number, Entry& to) {
            const unsigned c = number ^ box.octant;
            (twice + vi<4>::load(kOffsets[c])).store(to.at);
            to.node = children[__builtin_popcount(mask & ((1u << c) - 1u))];
            to.level = level, to.t = t[number];
          };
          const unsigned first = unsigned(__builtin_ctz(hit));
          for (hit &= hit - 1; hit;) {  // far to near
            const unsigned number = 31u - unsigned(__builtin_clz(hit));
            hit ^= 1u << number;
            child(number, *top++);
          }
          child(first, e);
          continue;
        }
      }
      do {
        if (top == stack) return false;
        e = *--top;
      } while (!AnyHit && e.t > best.t);
    }
  }

 private:
  static constexpr std::int32_t kOffsets[8][4] = {{0, 0, 0, 0}, {1, 0, 0, 0}, {0, 1, 0, 0}, {1, 1, 0, 0},
                                                  {0, 0, 1, 0}, {1, 0, 1, 0}, {0, 1, 1, 0}, {1, 1, 1, 0}};
};

inline void add_kernels(std::type_identity<octree::Octree>, KernelRows& rows) {
  ListedLeaves<octree::Octree, OctreeSingle>::add(rows);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
