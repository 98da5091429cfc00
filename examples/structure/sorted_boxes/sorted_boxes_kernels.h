// The kernels of sorted_boxes, written once and compiled for each instruction set: box tests of eight boxes, then the blocks
// behind them. For the closest hit the blocks are sorted by where the ray enters their boxes, and those beyond the nearest hit
// are left out; for any hit they are tested as they come.
#pragma once

#include <algorithm>
#include <vector>

#include "intersectors/leaf_block.h"
#include "intersectors/moller_trumbore.h"
#include "intersectors/watertight.h"
#include "traversal/box_test.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// A box that the ray meets, and where.
struct MetBox {
  float entry;
  std::uint32_t block;
  friend bool operator<(const MetBox& a, const MetBox& b) { return a.entry < b.entry || (a.entry == b.entry && a.block < b.block); }
};

// What follows is not inlined, so that all kernels of an instruction set share it. The project's own structures inline everything:
// 24 kernels then compile three times as long, and trace faster.

/// The box tests of one ray.
template <bool Padded>
class BoxScan {
 public:
  static constexpr int W = sorted_boxes::BoxGroup::kWidth;
  __attribute__((noinline)) BoxScan(const Ray& ray, float max_coordinate)
      : boxes_(BoxRay<W, Padded>(ray, max_coordinate)), tnear_(ray.tnear), tfar_(ray.tfar) {}
  /// The boxes of the group that the ray meets, as bits, and where it enters each.
  __attribute__((noinline)) unsigned met(const sorted_boxes::BoxGroup& group, float (&entries)[W]) const {
    vf<W> entry;
    const unsigned bits = boxes_.test(reinterpret_cast<const std::byte*>(&group), tnear_, tfar_, entry);
    entry.store(entries);
    return bits;
  }

 private:
  BoxLanes<W, Padded> boxes_;
  vf<W> tnear_, tfar_;
};

__attribute__((noinline)) inline void sort_near_to_far(std::vector<MetBox>& met) {
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
  using BoxGroup = sorted_boxes::BoxGroup;
  static constexpr int W = BoxGroup::kWidth;

 public:
  SortedBoxesTrace(const Accel& accel, Counters* counters)
      : accel_(static_cast<const sorted_boxes::SortedBoxes&>(accel)), counting_(counters) {}

  [[nodiscard]] Hit closest_hit(const Ray& ray) {
    NearestHit best{ray.tfar};
    if (is_valid_in_lanes(ray)) {
      const typename Intersector::RayData data(ray);
      met_.clear();
      each_box(ray, [&](float entry, std::uint32_t block) {
        met_.push_back({entry, block});
        return false;
      });
      sort_near_to_far(met_);
      for (const MetBox& m : met_) {
        if (m.entry > best.t) break;  // an equal one may hold the hit of a lower id
        nearer_hit<Block, Intersector>(data, block(m.block), accel_.vertices(), ray.tnear, best);
      }
    }
    return to_hit(best);
  }

  [[nodiscard]] bool any_hit(const Ray& ray) {
    if (!is_valid_in_lanes(ray)) return false;
    const typename Intersector::RayData data(ray);
    return each_box(ray, [&](float, std::uint32_t index) {
      return some_hit<Block, Intersector>(data, block(index), accel_.vertices(), ray.tnear, ray.tfar);
    });
  }

  void count_rays(std::size_t rays) {
    if constexpr (Counting::kCounting) counting_.counters.rays += rays;
  }

 private:
  /// Calls f(entry, block) for each box that the ray meets, until one returns true; whether one did.
  template <class F>
  bool each_box(const Ray& ray, F&& f) {
    const BoxScan<Padded> scan(ray, accel_.max_coordinate());
    for (std::size_t g = 0; g < accel_.groups(); ++g) {
      float entries[W];
      unsigned hit = scan.met(accel_.boxes()[g], entries);
      count_group(g, hit);
      for (; hit != 0; hit &= hit - 1) {
        const unsigned i = unsigned(__builtin_ctz(hit));
        if (f(entries[i], std::uint32_t(g * W + i))) return true;
      }
    }
    return false;
  }

  /// The block; counted as tested.
  const Block& block(std::uint32_t index) {
    const Block& b = accel_.template block_data<Block>()[index];
    if constexpr (Counting::kCounting) {
      const unsigned triangles = unsigned(triangles_in(b));
      ++counting_.counters.leaves, ++counting_.counters.blocks;
      counting_.counters.triangles += triangles;
      counting_.counters.lanes += Block::kWidth, counting_.counters.lanes_active += triangles;
    }
    return b;
  }

  void count_group(std::size_t group, unsigned hit) {
    if constexpr (Counting::kCounting) {
      const std::size_t boxes = std::min<std::size_t>(W, accel_.blocks() - group * W);
      ++counting_.counters.nodes;
      counting_.counters.boxes += boxes, counting_.counters.boxes_hit += unsigned(__builtin_popcount(hit));
      counting_.counters.lanes += W, counting_.counters.lanes_active += boxes;
    }
  }

  const sorted_boxes::SortedBoxes& accel_;
  Counting counting_;
  std::vector<MetBox> met_;  ///< grows as it must; one for the whole batch
};

template <class Block, class Intersector, bool Padded>
struct SortedBoxesMaker {
  template <class Counting>
  static void closest(const Accel& accel, RayBatch rays, std::span<Hit> hits, Counters* counters) {
    SortedBoxesTrace<Block, Intersector, Padded, Counting> trace(accel, counters);
    for (std::size_t i = 0; i < rays.size(); ++i) hits[i] = trace.closest_hit(rays[i]);
    trace.count_rays(rays.size());
  }
  template <class Counting>
  static void any(const Accel& accel, RayBatch rays, std::span<std::uint8_t> occluded, Counters* counters) {
    SortedBoxesTrace<Block, Intersector, Padded, Counting> trace(accel, counters);
    for (std::size_t i = 0; i < rays.size(); ++i) occluded[i] = trace.any_hit(rays[i]);
    trace.count_rays(rays.size());
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
