// One ray through the bounding interval hierarchy: closest hit and any hit. The ray keeps the
// interval [low, high] of t in which it is between all planes passed; a plane that ends an interval and one
// that begins one have constants of their own, so that padded intervals hold the exact ones
// (traversal/box_test.h). A NaN (plane and origin equal, 0 * inf) leaves an interval as it is.
#pragma once

#include "structures/bih/bih.h"
#include "traversal/batch_stack.h"
#include "traversal/box_test.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// One ray's constants by axis: those of BoxRay.
struct IntervalRay {
  float r[3], begin[3], end[3];
  unsigned negative[3];

  template <bool Padded>
  ARBORETUM_INLINE explicit IntervalRay(const BoxRay<2, Padded>& b) : IntervalRay(b.r, b.f, b.g) {}
  ARBORETUM_INLINE IntervalRay(Vec3f known_r, Vec3f f, Vec3f g) : r{known_r.x, known_r.y, known_r.z}, begin{f.x, f.y, f.z}, end{g.x, g.y, g.z} {
    for (int a = 0; a < 3; ++a) negative[a] = unsigned(__builtin_signbit(r[a]) != 0);
  }
  /// Where an interval begins that a plane begins.
  ARBORETUM_INLINE float at_begin(float plane, unsigned a) const {
    return kHasFma ? __builtin_fmaf(plane, r[a], -begin[a]) : (plane - begin[a]) * r[a];
  }
  ARBORETUM_INLINE float at_end(float plane, unsigned a) const {
    return kHasFma ? __builtin_fmaf(plane, r[a], -end[a]) : (plane - end[a]) * r[a];
  }
};

/// The later of a beginning and a plane's; the earlier of an end and a plane's. NaN for the plane's leaves
/// it.
ARBORETUM_INLINE float later(float plane, float low) {
  return plane > low ? plane : low;
}
ARBORETUM_INLINE float earlier(float plane, float high) {
  return plane < high ? plane : high;
}

struct IntervalEntry {
  std::uint32_t node;
  float low, high;
};

struct IntervalStack : BatchStack<IntervalEntry, 128> {
  explicit IntervalStack(const bih::Bih& tree) : BatchStack(tree.stack_entries()) {}
};

/// What lies below `node`, where the ray's interval is [low, high]. visits(code) is called for leaves and ends the search where it is true.
template <bool AnyHit, class Counting, class Visits>
ARBORETUM_INLINE bool search_bih(const bih::Bih& tree, const IntervalRay& interval, const bih::Node* node, float low, float high, NearestHit& best, const Counting& counting,
                                 IntervalEntry* const stack, Visits& visits) {
  IntervalEntry* top = stack;
  const bih::Node* const nodes = tree.nodes();
  for (;;) {
    const std::uint32_t kind = node->kind();
    if (kind < bih::Node::kLeaf) {
      const unsigned axis = kind, back = interval.negative[axis];
      const float near_high = earlier(interval.at_end(node->clip[back], axis), high);
      const float far_low = later(interval.at_begin(node->clip[1 - back], axis), low);
      const bool near = low <= near_high, far = far_low <= high;
      counting.node(2, 2, unsigned(near) + unsigned(far));
      const std::uint32_t first = node->first();
      if (near) {
        if (far) *top++ = {first + 1 - back, far_low, high};
        high = near_high, node = nodes + first + back;
        continue;
      }
      if (far) {
        low = far_low, node = nodes + first + 1 - back;
        continue;
      }
    } else if (kind == bih::Node::kLeaf) {
      if (visits(node->code())) return true;
    } else {
      const unsigned axis = kind - bih::Node::kClip, back = interval.negative[axis];
      low = later(interval.at_begin(node->clip[back], axis), low);
      high = earlier(interval.at_end(node->clip[1 - back], axis), high);
      counting.node(1, 1, low <= high);
      if (low <= high) {
        node = nodes + node->first();
        continue;
      }
    }
    do {
      if (top == stack) return false;
      --top;
    } while (!AnyHit && top->low > best.t);
    low = top->low, high = earlier(best.t, top->high), node = nodes + top->node;
  }
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
