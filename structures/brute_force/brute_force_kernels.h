// The kernels of brute_force: every block of the one leaf, in order. There is no box to test, so `fast` and
// `padded` are the same function; both rows exist, so that a sweep over box tests keeps its reference column.
#pragma once

#include "intersectors/leaf_block.h"
#include "intersectors/moller_trumbore.h"
#include "intersectors/pluecker.h"
#include "intersectors/watertight.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// What `blocks` blocks of a ray cost, the leaf they belong to included.
template <class Block, class Counting>
ARBORETUM_INLINE void count_brute_force(const brute_force::BruteForce& accel, std::size_t blocks,
                                        Counting& counting) {
  if constexpr (Counting::kCounting) {
    const std::size_t lanes = blocks * std::size_t(Block::kWidth);
    const std::size_t triangles = lanes < accel.triangles() ? lanes : accel.triangles();
    counting.counters.leaves += blocks != 0;
    counting.counters.blocks += blocks;
    counting.counters.triangles += triangles;
    counting.counters.lanes += lanes;
    counting.counters.lanes_active += triangles;
  }
}

template <class Block, class Intersector, class Counting>
void brute_force_closest_hit(const Accel& structure, RayBatch rays, std::span<Hit> hits,
                             Counters* counters) {
  const auto& accel = static_cast<const brute_force::BruteForce&>(structure);
  const std::span<const Block> blocks = accel.blocks<Block>();
  Counting counting(counters);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Ray& ray = rays[i];
    NearestHit best{ray.tfar};
    if (is_valid_in_lanes(ray)) {
      const typename Intersector::RayData data(ray);
      for (std::size_t b = 0; b < blocks.size(); ++b)
        closest_hit_block<Intersector>(data, readable(blocks[b], accel.vertices()), ray.tnear, best);
      count_brute_force<Block>(accel, blocks.size(), counting);
    }
    hits[i] = to_hit(best);
  }
  if constexpr (Counting::kCounting) counting.counters.rays += rays.size();
}

/// Stops at the first block that holds a hit; the counters have what was tested until then.
template <class Block, class Intersector, class Counting>
void brute_force_any_hit(const Accel& structure, RayBatch rays, std::span<std::uint8_t> occluded,
                         Counters* counters) {
  const auto& accel = static_cast<const brute_force::BruteForce&>(structure);
  const std::span<const Block> blocks = accel.blocks<Block>();
  Counting counting(counters);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Ray& ray = rays[i];
    occluded[i] = 0;
    if (!is_valid_in_lanes(ray)) continue;
    const typename Intersector::RayData data(ray);
    std::size_t b = 0;
    for (; b < blocks.size() && !occluded[i]; ++b)
      occluded[i] = any_hit_block<Intersector>(data, readable(blocks[b], accel.vertices()), ray.tnear, ray.tfar);
    count_brute_force<Block>(accel, b, counting);
  }
  if constexpr (Counting::kCounting) counting.counters.rays += rays.size();
}

template <class Block, class Intersector, bool /*Padded*/>
struct BruteForceMaker {
  static void closest_hit(const Accel& a, RayBatch r, std::span<Hit> h, Counters* c) {
    brute_force_closest_hit<Block, Intersector, NoCounters>(a, r, h, c);
  }
  static void any_hit(const Accel& a, RayBatch r, std::span<std::uint8_t> h, Counters* c) {
    brute_force_any_hit<Block, Intersector, NoCounters>(a, r, h, c);
  }
  static void count_closest_hit(const Accel& a, RayBatch r, std::span<Hit> h, Counters* c) {
    brute_force_closest_hit<Block, Intersector, WithCounters>(a, r, h, c);
  }
  static void count_any_hit(const Accel& a, RayBatch r, std::span<std::uint8_t> h, Counters* c) {
    brute_force_any_hit<Block, Intersector, WithCounters>(a, r, h, c);
  }
};

inline void add_kernels(std::type_identity<brute_force::BruteForce>, KernelRows& rows) {
  constexpr std::string_view name = brute_force::BruteForce::kName;
  add_rows<BruteForceMaker>(rows, name, "single", kIsa, BlocksOfWidth<EdgeBlock, kRegisterWidth>{},
                            TypeList<MollerTrumbore>{});
  add_rows<BruteForceMaker>(rows, name, "single", kIsa, BlocksOfWidth<VertexBlock, kRegisterWidth>{},
                            TypeList<Watertight>{});
  add_rows<BruteForceMaker>(rows, name, "single", kIsa, BlocksOfWidth<IndexBlock, kRegisterWidth>{},
                            TypeList<Watertight>{});
  add_rows<BruteForceMaker>(rows, name, "single", kIsa, TypeList<VertexBlock<4>>{},
                            TypeList<MollerTrumbore, Pluecker>{});
  add_rows<BruteForceMaker>(rows, name, "single", kIsa, TypeList<IndexBlock<4>>{}, TypeList<MollerTrumbore>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
