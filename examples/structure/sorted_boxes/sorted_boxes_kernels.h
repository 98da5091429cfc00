// The kernels of sorted_boxes, written once and compiled for each instruction set. A ray tests all boxes, eight at a time, sorts those that
// it meets by where it enters them, and tests their blocks in that order: until the next box begins beyond the nearest hit, or
// until anything is hit.
#pragma once

#include "intersectors/leaf_block.h"
#include "intersectors/moller_trumbore.h"
#include "intersectors/watertight.h"
#include "traversal/box_test.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// A box that the ray meets as one number: the bits of where it enters, then the block. Bits of floats from +0 on order as
/// integers, so these sort from near to far.
using MetBox = std::uint64_t;

[[nodiscard]] ARBORETUM_INLINE MetBox met_box(float entry, std::size_t block) {
  return std::uint64_t(__builtin_bit_cast(std::uint32_t, entry + 0.0f)) << 32 | block;  // -0 becomes +0
}
[[nodiscard]] ARBORETUM_INLINE float entry_of(MetBox box) {
  return __builtin_bit_cast(float, std::uint32_t(box >> 32));
}

// The next three are not inlined, so that kernels which differ in something else share them. The project's own structures inline
// everything: that compiles three times as long, and traces faster.

/// Every box that the ray meets, from near to far.
template <bool Padded, class Counting>
__attribute__((noinline)) void find_boxes(const sorted_boxes::SortedBoxes& accel, const Ray& ray, std::vector<MetBox>& met, Counting& counting) {
  constexpr int W = sorted_boxes::BoxGroup::kWidth;
  const BoxLanes<W, Padded> boxes(BoxRay<W, Padded>(ray, accel.max_coordinate()));
  const vf<W> tnear(ray.tnear), tfar(ray.tfar);
  met.clear();
  for (std::size_t group = 0; group < accel.groups(); ++group) {
    vf<W> entry;
    unsigned hit = boxes.test(reinterpret_cast<const std::byte*>(accel.boxes() + group), tnear, tfar, entry);
    if constexpr (Counting::kCounting) {
      const std::size_t exist = std::min<std::size_t>(W, accel.blocks() - group * W);
      ++counting.counters.nodes;
      counting.counters.boxes += exist, counting.counters.boxes_hit += unsigned(__builtin_popcount(hit));
      counting.counters.lanes += W, counting.counters.lanes_active += exist;
    }
    alignas(64) float entries[W];
    entry.store(entries);
    for (; hit != 0; hit &= hit - 1) {
      const unsigned i = unsigned(__builtin_ctz(hit));
      met.push_back(met_box(entries[i], group * W + i));
    }
  }
  std::sort(met.begin(), met.end());
}

template <class Block, class Intersector>
__attribute__((noinline)) void nearer_hit(const typename Intersector::RayData& ray, const Block& block, const Vec3f* vertices, float tnear,
                                          NearestHit& best) {
  closest_hit_block<Intersector>(ray, readable(block, vertices), tnear, best);
}

template <class Block, class Intersector>
__attribute__((noinline)) bool some_hit(const typename Intersector::RayData& ray, const Block& block, const Vec3f* vertices, float tnear,
                                        float tfar) {
  return any_hit_block<Intersector>(ray, readable(block, vertices), tnear, tfar);
}

template <class Block, class Intersector, bool Padded, class Counting>
class SortedBoxesTrace {
 public:
  SortedBoxesTrace(const Accel& accel, Counters* counters)
      : accel_(static_cast<const sorted_boxes::SortedBoxes&>(accel)), counting_(counters) {}

  [[nodiscard]] Hit closest_hit(const Ray& ray) {
    NearestHit best{ray.tfar};
    if (is_valid_in_lanes(ray)) {
      const typename Intersector::RayData data(ray);
      find_boxes<Padded>(accel_, ray, met_, counting_);
      for (MetBox box : met_) {
        if (entry_of(box) > best.t) break;  // a box at an equal distance may hold the hit of a lower id
        nearer_hit<Block, Intersector>(data, block(box), accel_.vertices(), ray.tnear, best);
      }
    }
    count_ray();
    return to_hit(best);
  }

  [[nodiscard]] bool any_hit(const Ray& ray) {
    bool found = false;
    if (is_valid_in_lanes(ray)) {
      const typename Intersector::RayData data(ray);
      find_boxes<Padded>(accel_, ray, met_, counting_);
      for (auto box = met_.begin(); box != met_.end() && !found; ++box)
        found = some_hit<Block, Intersector>(data, block(*box), accel_.vertices(), ray.tnear, ray.tfar);
    }
    count_ray();
    return found;
  }

 private:
  /// The block in that box; counted as a leaf that is tested.
  const Block& block(MetBox box) {
    const Block& b = accel_.template block_data<Block>()[std::uint32_t(box)];
    if constexpr (Counting::kCounting) {
      const unsigned triangles = unsigned(triangles_in(b));
      ++counting_.counters.leaves, ++counting_.counters.blocks;
      counting_.counters.triangles += triangles;
      counting_.counters.lanes += Block::kWidth, counting_.counters.lanes_active += triangles;
    }
    return b;
  }

  void count_ray() {
    if constexpr (Counting::kCounting) ++counting_.counters.rays;
  }

  const sorted_boxes::SortedBoxes& accel_;
  Counting counting_;
  std::vector<MetBox> met_;  ///< as long as it must be; one for the whole batch
};

template <class Block, class Intersector, bool Padded>
struct SortedBoxesMaker {
  template <class Counting>
  static void closest(const Accel& accel, RayBatch rays, std::span<Hit> hits, Counters* counters) {
    SortedBoxesTrace<Block, Intersector, Padded, Counting> trace(accel, counters);
    for (std::size_t i = 0; i < rays.size(); ++i) hits[i] = trace.closest_hit(rays[i]);
  }
  template <class Counting>
  static void any(const Accel& accel, RayBatch rays, std::span<std::uint8_t> occluded, Counters* counters) {
    SortedBoxesTrace<Block, Intersector, Padded, Counting> trace(accel, counters);
    for (std::size_t i = 0; i < rays.size(); ++i) occluded[i] = trace.any_hit(rays[i]);
  }
  static void closest_hit(const Accel& a, RayBatch r, std::span<Hit> h, Counters* c) { closest<NoCounters>(a, r, h, c); }
  static void any_hit(const Accel& a, RayBatch r, std::span<std::uint8_t> o, Counters* c) { any<NoCounters>(a, r, o, c); }
  static void count_closest_hit(const Accel& a, RayBatch r, std::span<Hit> h, Counters* c) { closest<WithCounters>(a, r, h, c); }
  static void count_any_hit(const Accel& a, RayBatch r, std::span<std::uint8_t> o, Counters* c) { any<WithCounters>(a, r, o, c); }
};

inline void add_kernels(std::type_identity<sorted_boxes::SortedBoxes>, KernelRows& rows) {
  constexpr std::string_view name = sorted_boxes::SortedBoxes::kName;
  constexpr int width = kRegisterWidth < 8 ? 4 : 8;  // as default_leaf() chooses
  add_rows<SortedBoxesMaker>(rows, name, "single", kIsa, TypeList<EdgeBlock<width>>{}, TypeList<MollerTrumbore>{});
  add_rows<SortedBoxesMaker>(rows, name, "single", kIsa, TypeList<VertexBlock<width>>{}, TypeList<Watertight>{});
  add_rows<SortedBoxesMaker>(rows, name, "single", kIsa, TypeList<IndexBlock<4>>{}, TypeList<Watertight>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
