// One ray through the bounding interval hierarchy: closest hit front to back, any hit back to front, since what a
// shadow ray meets stands by its light more often than by its origin (docs/performance/other-structures.md). The ray
// keeps the interval [low, high] of t in which it is between all planes passed; a plane that ends an interval and one
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
  ARBORETUM_INLINE explicit IntervalRay(const BoxRay<2, Padded>& b)
      : r{b.r.x, b.r.y, b.r.z}, begin{b.near_offset.x, b.near_offset.y, b.near_offset.z},
        end{b.far_offset.x, b.far_offset.y, b.far_offset.z}, negative{b.octant & 1u, b.octant >> 1 & 1u,
                                                                      b.octant >> 2} {}
  ARBORETUM_INLINE IntervalRay(Vec3f known_r, Vec3f f, Vec3f g) : IntervalRay(BoxRay<2, true>(known_r, f, g)) {}
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
ARBORETUM_INLINE float later(float plane, float low) { return plane > low ? plane : low; }
ARBORETUM_INLINE float earlier(float plane, float high) { return plane < high ? plane : high; }

struct IntervalEntry {
  std::uint32_t node;
  float low, high;
};

struct IntervalStack : BatchStack<IntervalEntry, 128> {
  explicit IntervalStack(const bih::Bih& tree) : BatchStack(tree.stack_entries()) {}
};

/// Cuts [low, high] to the ray's part within the scene's box; empty, low > high, where there is none.
ARBORETUM_INLINE void clip_to_scene(const bih::Bih& tree, const IntervalRay& interval, float& low, float& high) {
  for (unsigned a = 0; a < 3; ++a) {
    const float faces[2] = {(&tree.bounds().lower.x)[a], (&tree.bounds().upper.x)[a]};
    low = later(interval.at_begin(faces[interval.negative[a]], a), low);
    high = earlier(interval.at_end(faces[1 - interval.negative[a]], a), high);
  }
}

inline constexpr std::uint32_t kNoNode = ~0u;

/// At an inner node of that kind, with the ray's interval [low, high] there: the child to go on with and its interval,
/// or kNoNode where the ray meets none; where it meets two, the one that is visited later goes to the stack.
template <bool AnyHit, class Counting>
ARBORETUM_INLINE std::uint32_t step_bih(const bih::Node* node, std::uint32_t kind, const IntervalRay& interval,
                                        float& low, float& high, IntervalEntry*& top, const Counting& counting) {
  const std::uint32_t first = node->first();
  if (kind < bih::Node::kLeaf) {
    const unsigned axis = kind, back = interval.negative[axis];
    const IntervalEntry near{first + back, low, earlier(interval.at_end(node->clip[back], axis), high)},
        far{first + 1 - back, later(interval.at_begin(node->clip[1 - back], axis), low), high};
    const IntervalEntry &next = AnyHit ? far : near, &waits = AnyHit ? near : far;
    const bool in_next = next.low <= next.high, in_waits = waits.low <= waits.high;
    counting.node(2, 2, unsigned(in_next) + unsigned(in_waits));
    const auto take = [&](const IntervalEntry& child) { return low = child.low, high = child.high, child.node; };
    if (in_next) {
      if (in_waits) *top++ = waits;
      return take(next);
    }
    return in_waits ? take(waits) : kNoNode;
  }
  const unsigned axis = kind - bih::Node::kClip, back = interval.negative[axis];
  low = later(interval.at_begin(node->clip[back], axis), low);
  high = earlier(interval.at_end(node->clip[1 - back], axis), high);
  counting.node(1, 1, low <= high);
  return low <= high ? first : kNoNode;
}

/// The next that waits and its interval, or kNoNode; `nearest`: beyond it nothing is visited.
template <bool AnyHit>
ARBORETUM_INLINE std::uint32_t pop_bih(IntervalEntry*& top, const IntervalEntry* stack, float& low, float& high,
                                       float nearest) {
  do {
    if (top == stack) return kNoNode;
    --top;
  } while (!AnyHit && top->low > nearest);
  low = top->low, high = earlier(nearest, top->high);
  return top->node;
}

/// What lies below `node`, where the ray's interval is [low, high]. visits(code) is called for leaves and ends the
/// search where it is true.
template <bool AnyHit, class Counting, class Visits>
ARBORETUM_INLINE bool search_bih(const bih::Bih& tree, const IntervalRay& interval, const bih::Node* node, float low,
                                 float high, NearestHit& best, const Counting& counting, IntervalEntry* const stack,
                                 Visits& visits) {
  IntervalEntry* top = stack;
  const bih::Node* const nodes = tree.nodes();
  for (;;) {
    std::uint32_t next = kNoNode;
    if (const std::uint32_t kind = node->kind(); kind != bih::Node::kLeaf) {
      next = step_bih<AnyHit>(node, kind, interval, low, high, top, counting);
    } else if (visits(node->code())) {
      return true;
    }
    if (next == kNoNode) next = pop_bih<AnyHit>(top, stack, low, high, best.t);
    if (next == kNoNode) return false;
    node = nodes + next;
  }
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
