// One ray through a kd-tree, front to back; closest hit and any hit.
//
// A cell's interval of t is what its planes leave of the ray. A plane at s on an axis with origin o and direction d is met at
// t = (s - o) / d, computed as s * r - o * r. Padded, the side that the ray comes from ends at t + e and the other begins at t - e,
// with e = 2^-21 (M + |o|)|r|, M the scene's largest |coordinate|; traversal/box_test.h proves for boxes that this covers the rounding of
// r, o * r and t, fused or not (unfused, s * r rounds by another u M |r|: 5 u in all, still under e). So no cell is missed that the exact ray touches, neither
// cells without thickness nor neighbours across a plane that the ray lies in: a component below 2^-60 of the largest gets
// r = 2^60 / |d|max, and where the origin is within the pad of such a plane both sides are visited. Rays with such a component
// get this pad for it with `fast`, too; otherwise `fast` pads nothing and keeps no promise. The two differ in constants, not in code.
// Comparisons are written so that NaN, from values beyond float's range, visits both sides.
//
// A hit counts wherever it lies on the ray, in its cell or beyond. A cell is left out only when it begins, rounded down, beyond the
// nearest hit: one that begins at an equal t may hold the triangle with the lower id.
//
// A step has no branch but the one that leaves the loop at a leaf: both children are loaded while t is computed, and the
// one that is not taken is written to the stack whether it stays there or not.
#pragma once

#include "intersectors/leaf_block.h"

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

  ARBORETUM_INLINE KdRay(const Ray& ray, float max_coordinate, float pad) {
    const float x = __builtin_fabsf(ray.direction.x), y = __builtin_fabsf(ray.direction.y), z = __builtin_fabsf(ray.direction.z);
    const float xy = x > y ? x : y, largest = xy > z ? xy : z;
    const float tiny = largest * 0x1p-60f, limit = 0x1p60f / largest;
    const float* o = &ray.origin.x;
    const float* d = &ray.direction.x;
    for (int k = 0; k < 3; ++k) {
      const bool parallel = !(__builtin_fabsf(d[k]) > tiny);
      r[k] = parallel ? __builtin_copysignf(limit, d[k]) : 1.0f / d[k];
      const float e = (parallel ? kPad : pad) * (max_coordinate + __builtin_fabsf(o[k])) * __builtin_fabsf(r[k]) + (parallel ? 0x1p-100f : pad * 0x1p-79f);
      const float at = o[k] * r[k];
      enter[k] = at + e, leave[k] = at - e;
      far[k] = __builtin_signbit(r[k]) ? 0u : 8u;
    }
    r[3] = enter[3] = leave[3] = 0.0f, far[3] = 0u;
  }

  static constexpr float kPad = 0x1p-21f;

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

/// What a batch needs of the tree.
struct KdView {
  const std::byte* base;
  std::uint64_t root;
  Bounds3f bounds;
  const Vec3f* vertices;
};

template <class Block, class Intersector, class Counting>
struct KdSingleRay {
  template <bool AnyHit>
  static ARBORETUM_INLINE bool trace(const KdView& tree, KdStackEntry* stack, const Ray& ray, const KdRay& planes, NearestHit& best, Counting counting) {
    float begin = ray.tnear, end = best.t;
    for (unsigned axis = 0; axis < 3; ++axis) {
      const bool up = planes.far[axis] != 0;
      const float low = (&tree.bounds.lower.x)[axis], high = (&tree.bounds.upper.x)[axis];
      const float in = planes.entering(up ? low : high, axis), out = planes.leaving(up ? high : low, axis);
      begin = in > begin ? in : begin, end = out < end ? out : end;
    }
    if (begin > end) return false;
    const typename Intersector::RayData data(ray);
    KdStackEntry* top = stack;
    std::uint64_t node = tree.root;
    for (;;) {
      for (;;) {
        const auto link = std::uint32_t(node >> 32);
        const unsigned axis = link & 3u;
        if (axis == 3) break;
        const float plane = __builtin_bit_cast(float, std::uint32_t(node));
        const std::byte* pair = tree.base + std::size_t(link & ~3u) * 4;
        const std::uint32_t far_offset = planes.far[axis];
        std::uint64_t near, far;
        std::memcpy(&near, pair + (far_offset ^ 8u), 8), std::memcpy(&far, pair + far_offset, 8);
        const float leave = planes.leaving(plane, axis), enter = planes.entering(plane, axis);
        const bool skip_near = (leave < begin) | (near == kdtree::kEmptyCell), skip_far = (enter > end) | (far == kdtree::kEmptyCell);
        if constexpr (Counting::kCounting) count_node(counting, 2u - skip_near - skip_far);
        const float far_begin = enter > begin ? enter : begin;
        if (skip_near) {
          if (skip_far) goto pop;
          node = far, begin = far_begin;
        } else {
          top->node = far, top->begin = far_begin, top->end = end;
          top += !skip_far;
          node = near, end = leave < end ? leave : end;
        }
      }
      {
        const auto* block = reinterpret_cast<const Block*>(tree.base + std::size_t(std::uint32_t(node >> 32) & ~3u) * 4);
        const Block* const last = block + std::uint32_t(node);
        if constexpr (Counting::kCounting) count_leaf(counting, block, last);
        for (; block != last; ++block) {
          if constexpr (AnyHit) {
            if (any_hit_block<Intersector>(data, readable(*block, tree.vertices), ray.tnear, ray.tfar)) return true;
          } else {
            closest_hit_block<Intersector>(data, readable(*block, tree.vertices), ray.tnear, best);
          }
        }
      }
    pop:
      do {
        if (top == stack) return false;
        --top;
      } while (!AnyHit && top->begin > best.t);
      node = top->node, begin = top->begin;
      end = top->end < best.t ? top->end : best.t;
    }
  }

 private:
  /// A plane decides about two cells; a lane each.
  static void count_node(Counting& counting, unsigned visited) {
    ++counting.counters.nodes;
    counting.counters.boxes += 2, counting.counters.boxes_hit += visited;
    counting.counters.lanes += 2, counting.counters.lanes_active += 2;
  }
  static void count_leaf(Counting& counting, const Block* block, const Block* last) {
    counting.counters.leaves += block != last;  // an empty cell is none
    for (; block != last; ++block) {
      const auto triangles = unsigned(triangles_in(*block));
      ++counting.counters.blocks;
      counting.counters.lanes += Block::kWidth;
      counting.counters.triangles += triangles, counting.counters.lanes_active += triangles;
    }
  }
};

/// A stack for one batch: on this frame, on the heap for a tree deeper than any that the builders make.
class KdStack {
 public:
  explicit KdStack(std::size_t entries) {
    if (entries > kInline) heap_.resize(entries), data_ = heap_.data();
  }
  KdStack(const KdStack&) = delete;
  KdStack& operator=(const KdStack&) = delete;
  [[nodiscard]] KdStackEntry* data() noexcept { return data_; }

 private:
  static constexpr std::size_t kInline = 80;
  KdStackEntry inline_[kInline];
  std::vector<KdStackEntry> heap_;
  KdStackEntry* data_ = inline_;
};

/// Calls trace(view, stack, ray, constants, i) for every valid ray of a batch.
template <class Trace>
ARBORETUM_INLINE void kd_for_each_ray(const Accel& accel, RayBatch rays, float pad, Trace&& trace) {
  const auto& tree = static_cast<const kdtree::KdTree&>(accel);
  const KdView view{tree.base(), __builtin_bit_cast(std::uint64_t, tree.root()), tree.bounds(), tree.vertices()};
  const float max_coordinate = tree.max_coordinate();
  KdStack stack(tree.stack_entries());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    trace(i, [&](auto&& go) {
      if (is_valid_in_lanes(rays[i])) go(view, stack.data(), KdRay(rays[i], max_coordinate, pad));
    });
  }
}

template <class Block, class Intersector, class Counting>
void kd_closest_hit(const Accel& accel, RayBatch rays, std::span<Hit> hits, Counters* counters, float pad) {
  Counting counting(counters);
  kd_for_each_ray(accel, rays, pad, [&](std::size_t i, auto&& with_valid) {
    NearestHit best{rays[i].tfar};
    with_valid([&](const KdView& view, KdStackEntry* stack, const KdRay& planes) {
      KdSingleRay<Block, Intersector, Counting>::template trace<false>(view, stack, rays[i], planes, best, counting);
    });
    hits[i] = to_hit(best);
  });
  if constexpr (Counting::kCounting) counting.counters.rays += rays.size();
}

template <class Block, class Intersector, class Counting>
void kd_any_hit(const Accel& accel, RayBatch rays, std::span<std::uint8_t> occluded, Counters* counters, float pad) {
  Counting counting(counters);
  kd_for_each_ray(accel, rays, pad, [&](std::size_t i, auto&& with_valid) {
    NearestHit best{rays[i].tfar};
    bool hit = false;
    with_valid([&](const KdView& view, KdStackEntry* stack, const KdRay& planes) {
      hit = KdSingleRay<Block, Intersector, Counting>::template trace<true>(view, stack, rays[i], planes, best, counting);
    });
    occluded[i] = hit;
  });
  if constexpr (Counting::kCounting) counting.counters.rays += rays.size();
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
