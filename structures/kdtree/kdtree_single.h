// One ray through a kd-tree: closest hit front to back, any hit back to front, since what a shadow ray meets stands by
// its light more often than by its origin (docs/performance/other-structures.md).
//
// A cell's interval of t is what its planes leave of the ray. A plane at s on an axis with origin o and direction d is
// met at t = (s - o) / d, computed as s * r - o * r. Padded, the side that the ray comes from ends at t + e and the
// other begins at t - e, with e = 2^-21 (M + |o|)|r|, M the scene's largest |coordinate| (or less, and then triangles
// are thicker: structures/box_pads.h); traversal/box_test.h proves
// for boxes that this covers the rounding of r, o * r and t, fused or not (unfused, s * r rounds by another u M |r|: 5
// u in all, still under e). So no cell is missed that the exact ray touches, neither cells without thickness nor
// neighbours across a plane that the ray lies in: a component below 2^-60 of the largest gets r = 2^60 / |d|max, and
// where the origin is within the pad of such a plane both sides are visited. Rays with such a component get this pad
// for it with `fast`, too; otherwise `fast` pads nothing and keeps no promise. The two differ in constants, not in
// code. An axis whose constants overflow is left out: both sides of its planes are visited. So they are where a t is
// NaN, by the way comparisons are written.
//
// A hit counts wherever it lies on the ray, in its cell or beyond. A cell is left out only when it begins, rounded
// down, beyond the nearest hit: one that begins at an equal t may hold the triangle with the lower id.
//
// A step has no branch but the one that leaves the loop at a leaf: both children are loaded while t is computed, and
// the one that is not taken is written to the stack whether it stays there or not.
#pragma once

#include "traversal/batch_stack.h"
#include "traversal/box_test.h"
#include "traversal/single_rays.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

struct KdStackEntry {
  std::uint64_t node;
  float begin, end;
};

/// One ray's constants by axis; index 3 is read for leaves, and of no consequence.
struct KdRay {
  float r[4], enter[4], leave[4];  ///< t of a plane at s, rounded down: s * r - enter; rounded up: s * r - leave
  std::uint32_t far[4];            ///< byte offset within a pair of the child that the ray comes to last

  static constexpr float kPad = 0x1p-21f;
  static constexpr float kAllOfT = std::numeric_limits<float>::max();

  /// The constants of a lane's axis, or of one axis of a lane's ray. `largest` and `origin()`: the largest |component|
  /// of the ray's direction and origin; `pad`: kPad, or 0 for `fast` planes. Returns the lanes whose axis counts: where
  /// constants may have overflowed, or a parallel ray comes from so far that its pad is less than t
  /// (traversal/box_test.h), it is left out, with a reciprocal of 1 and constants by which every plane is met at all t.
  template <class F, class Origin>
  static ARBORETUM_INLINE auto constants(F o, F d, F largest, const Origin& origin, float max_coordinate, float pad,
                                         F& r, F& enter, F& leave) {
    r = F(1.0f) / d;
    F share(pad), least(pad * (BoxPad::kLeast / kPad));
    // Branches, rarely taken: no division waits for `largest`.
    const auto parallel = ~(abs(d) > largest * F(0x1p-60f));
    if (__builtin_expect(any(parallel), 0)) {
      r = select(parallel, xor_sign(F(0x1p60f) / largest, sign_bits(d)), r);
      share = select(parallel, F(kPad), share), least = select(parallel, F(BoxPad::kLeast), least);
    }
    // In this order, since a share of a tiny scene may be nothing. Where the product overflows the axis is left out, as
    // below.
    const F at = o * r;
    F e = share * ((F(max_coordinate) + abs(o)) * abs(r)) + least;
    if (__builtin_expect(any(parallel), 0)) e = pad_or_leave_out(e, parallel, F(max_coordinate), origin(), largest);
    enter = at + e, leave = at - e;
    const auto fits = abs(enter) + abs(leave) < F(kTooLarge);
    if (__builtin_expect(any(~fits), 0)) {
      r = select(fits, r, xor_sign(F(1.0f), sign_bits(r)));
      enter = select(fits, enter, F(kAllOfT)), leave = select(fits, leave, F(-kAllOfT));
    }
    return fits;
  }

  KdRay() = default;
  ARBORETUM_INLINE KdRay(const Ray& ray, float max_coordinate, float pad) {
    using F = vf<4>;  // the axes stand in lanes
    F rs, in, out;
    constants(
        F::load(&ray.origin), xyzx(F::load(&ray.direction)), F(largest_component(ray.direction)),
        [&] { return F(largest_component(ray.origin)); }, max_coordinate, pad, rs, in, out);
    rs.store(r), in.store(enter), out.store(leave);
    const unsigned negative = sign_mask(rs);
    for (unsigned k = 0; k < 3; ++k) far[k] = negative >> k & 1u ? 0u : 8u;
    r[3] = enter[3] = leave[3] = 0.0f, far[3] = 0u;
  }

  /// Cuts [begin, end] down to the part of the ray within the bounds; begin > end where there is none.
  ARBORETUM_INLINE void clip(const Bounds3f& bounds, float& begin, float& end) const {
    for (unsigned axis = 0; axis < 3; ++axis) {
      const bool up = far[axis] != 0;
      const float low = bounds.lower[axis], high = bounds.upper[axis];
      const float in = entering(up ? low : high, axis), out = leaving(up ? high : low, axis);
      begin = in > begin ? in : begin, end = out < end ? out : end;
    }
  }

  static ARBORETUM_INLINE float fused(float s, float r, float c) {
    if constexpr (kHasFma) {
      return __builtin_fmaf(s, r, -c);
    } else {
      return s * r - c;
    }
  }
  ARBORETUM_INLINE float entering(float plane, unsigned axis) const { return fused(plane, r[axis], enter[axis]); }
  ARBORETUM_INLINE float leaving(float plane, unsigned axis) const { return fused(plane, r[axis], leave[axis]); }
};

/// A node's pair of children, or a leaf's blocks.
ARBORETUM_INLINE const std::byte* place_in_kdtree(const std::byte* base, std::uint64_t node) {
  return base + std::size_t(std::uint32_t(node >> 32) & ~3u) * 4;
}

/// The two sides of a plane, of a cell that the ray is in within [begin, end]: near within [begin, near_end], far
/// within [far_begin, end]. (As two entries they would go through memory where one of them is
/// gone on with.)
struct KdSides {
  std::uint64_t near, far;
  float near_end, far_begin;
  bool in_near, in_far;  ///< whether the ray meets them
};
/// Those of the inner node with the bits `node`. Both children are loaded while t is computed.
ARBORETUM_INLINE KdSides sides_of(std::uint64_t node, const std::byte* base, const KdRay& planes, float begin,
                                  float end) {
  const unsigned axis = std::uint32_t(node >> 32) & 3u;
  const std::byte* const pair = place_in_kdtree(base, node);
  const float plane = __builtin_bit_cast(float, std::uint32_t(node));
  const std::uint32_t far_offset = planes.far[axis];
  std::uint64_t near, far;
  std::memcpy(&near, pair + (far_offset ^ 8u), 8), std::memcpy(&far, pair + far_offset, 8);
  const float leave = planes.leaving(plane, axis), enter = planes.entering(plane, axis);
  return {near,
          far,
          leave < end ? leave : end,
          enter > begin ? enter : begin,
          !((leave < begin) | (near == kdtree::kEmptyCell)),
          !((enter > end) | (far == kdtree::kEmptyCell))};
}

/// One ray from `node` on, within [begin, end] of it; what `leaves` keep for it is `data`. Returns whether an any hit
/// was found; a closest hit updates `best`. `depth`: of the node, where it is counted.
template <bool AnyHit, class Leaves, class Counting>
ARBORETUM_INLINE bool search_kdtree(const std::byte* const base, std::uint64_t node, float begin, float end,
                                    const KdRay& planes, KdStackEntry* const stack, const Ray& ray,
                                    const Leaves& leaves, typename Leaves::RayData& data, NearestHit& best,
                                    const LeafForm& form, const Counting& counting,
                                    typename Counting::Depth depth = {}) {
  KdStackEntry* top = stack;
  typename Counting::Depths depths(depth);
  for (;;) {
    for (;;) {
      if ((std::uint32_t(node >> 32) & 3u) == 3) break;
      const KdSides s = sides_of(node, base, planes, begin, end);
      // A plane decides about two cells; a lane each.
      counting.node(2, 2, unsigned(s.in_near) + unsigned(s.in_far));
      counting.at_depth(depths.current(), 2, 2);
      if constexpr (Counting::kCounting) {
        if (s.in_near && s.in_far) depths.push(top - stack, top - stack + 1);
      }
      depths.descend();
      if constexpr (AnyHit) {
        if (s.in_far) {
          top->node = s.near, top->begin = begin, top->end = s.near_end;
          top += s.in_near;
          node = s.far, begin = s.far_begin;
        } else {
          if (!s.in_near) goto pop;
          node = s.near, end = s.near_end;
        }
      } else {
        if (s.in_near) {
          top->node = s.far, top->begin = s.far_begin, top->end = end;
          top += s.in_far;
          node = s.near, end = s.near_end;
        } else {
          if (!s.in_far) goto pop;
          node = s.far, begin = s.far_begin;
        }
      }
    }
    if (const auto count = std::uint32_t(node); count != 0) {  // an empty cell is no leaf
      const std::byte* const blocks = place_in_kdtree(base, node);
      if constexpr (AnyHit) {
        if (any_hit_in_leaf(leaves, data, form, counting, blocks, count, ray.tnear, ray.tfar)) return true;
      } else {
        counting.leaf(form, blocks, count);
        leaves.closest_hit(data, blocks, count, ray.tnear, best);
      }
    }
  pop:
    do {
      if (top == stack) return false;
      --top;
    } while (!AnyHit && top->begin > best.t);
    depths.pop(top - stack);
    node = top->node, begin = top->begin;
    end = top->end < best.t ? top->end : best.t;
  }
}

using KdStack = BatchStack<KdStackEntry, 80>;

template <class Leaves, class Counting>
class KdSingle {
 public:
  KdSingle(const Accel& accel, const KernelRow& row, Counting counting)
      : KdSingle(static_cast<const kdtree::KdTree&>(accel), row, counting) {}

  template <bool AnyHit>
  ARBORETUM_INLINE bool trace(const Ray& ray, float /*time*/, NearestHit& best) {
    typename Leaves::RayData data = leaves_.prepare(ray);
    const KdRay planes(ray, max_coordinate_, pad_);
    float begin = ray.tnear, end = best.t;
    planes.clip(bounds_, begin, end);
    const bool hit = !(begin > end) && search_kdtree<AnyHit>(base_, root_, begin, end, planes, stack_.data(), ray,
                                                             leaves_, data, best, form_, counting_);
    if constexpr (!AnyHit) leaves_.finish(data, best);
    return hit;
  }

 private:
  KdSingle(const kdtree::KdTree& tree, const KernelRow& row, Counting counting)
      : base_(tree.base()), root_(__builtin_bit_cast(std::uint64_t, tree.root())), bounds_(tree.bounds()),
        max_coordinate_(tree.max_coordinate()), pad_(row.box == "padded" ? KdRay::kPad : 0.0f),
        leaves_(row, tree.vertices()), form_(*row.tests->form), counting_(counting), stack_(tree.stack_entries()) {}

  const std::byte* base_;
  std::uint64_t root_;
  Bounds3f bounds_;
  float max_coordinate_, pad_;
  Leaves leaves_;
  const LeafForm& form_;
  Counting counting_;
  KdStack stack_;
};

/// `fast` and `padded` are one function with other constants.
template <class Leaves, bool, class Counting>
using KdKernel = KdSingle<Leaves, Counting>;

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
