// The kernels of the kd-tree: which leaf blocks and intersectors it has on this instruction set.
#pragma once

#include "intersectors/moller_trumbore.h"
#include "intersectors/pluecker.h"
#include "intersectors/watertight.h"
#include "structures/kdtree/kdtree_single.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// `fast` and `padded` are one function with other constants.
template <class Block, class Intersector, bool Padded>
struct KdSingle {
  static constexpr float kPad = Padded ? KdRay::kPad : 0.0f;
  static void closest_hit(const Accel& a, RayBatch r, std::span<Hit> h, Counters* c) { kd_closest_hit<Block, Intersector, NoCounters>(a, r, h, c, kPad); }
  static void any_hit(const Accel& a, RayBatch r, std::span<std::uint8_t> h, Counters* c) { kd_any_hit<Block, Intersector, NoCounters>(a, r, h, c, kPad); }
  static void count_closest_hit(const Accel& a, RayBatch r, std::span<Hit> h, Counters* c) { kd_closest_hit<Block, Intersector, WithCounters>(a, r, h, c, kPad); }
  static void count_any_hit(const Accel& a, RayBatch r, std::span<std::uint8_t> h, Counters* c) { kd_any_hit<Block, Intersector, WithCounters>(a, r, h, c, kPad); }
};

inline void add_kernels(std::type_identity<kdtree::KdTree>, KernelRows& rows) {
  constexpr std::string_view name = kdtree::KdTree::kName;
  // The full leaf axis for the fastest and the crack-free intersector; else the default leaf (compile time).
  add_rows<KdSingle>(rows, name, "single", kIsa, BlocksOfWidth<EdgeBlock, kRegisterWidth>{}, TypeList<MollerTrumbore>{});
  add_rows<KdSingle>(rows, name, "single", kIsa, BlocksOfWidth<VertexBlock, kRegisterWidth>{}, TypeList<Watertight>{});
  add_rows<KdSingle>(rows, name, "single", kIsa, TypeList<VertexBlock<4>>{}, TypeList<MollerTrumbore, Pluecker>{});
  add_rows<KdSingle>(rows, name, "single", kIsa, BlocksOfWidth<IndexBlock, kRegisterWidth>{}, TypeList<Watertight>{});
  add_rows<KdSingle>(rows, name, "single", kIsa, TypeList<IndexBlock<4>>{}, TypeList<MollerTrumbore>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
