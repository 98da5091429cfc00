// The rays of a packet that meet an instance, mapped into its object space, go through the structure below as a packet
// too: where that is bvh2 to bvh16, whose packets take leaves that are made elsewhere and a pad of the rays' own. A
// leaf's blocks are mapped into world space once for all of its rays.
#pragma once

#include "structures/bvh/bvh_packet.h"
#include "structures/two_level/placed_leaves_single.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Rays of a packet in one instance.
struct PlacedGroup {
  static constexpr int kMost = LaneRays::kMost;
  int threshold = 0;  ///< where no more rays are left they go on alone
  int count = 0;
  float pad = 0.0f;  ///< the largest of the rays' (PlacedRay)
  Ray ray[kMost];    ///< in object space
  PreparedRay* prepared[kMost];
  NearestHit best[kMost];  ///< what they have met, before and after
  int number[kMost];       ///< theirs in the packet
};

/// Leaves (traversal/leaves.h) of an instance for the rays of a group.
class PlacedGroupLeaves {
 public:
  using RayData = PreparedRay*;
  static constexpr bool kRaysInLanes = false, kBlockByBlock = false, kMany = true;

  PlacedGroupLeaves(PlacedBlocks& blocks, const PlacedGroup& group) : blocks_(&blocks), group_(&group) {}

  RayData prepare(const Ray& ray) const { return group_->prepared[&ray - group_->ray]; }
  [[nodiscard]] NearestHit best_so_far(int i) const { return group_->best[i]; }
  bool closest_hit(RayData ray, const std::byte* blocks, unsigned count, float tnear, NearestHit& best) const {
    return PlacedLeaves(*blocks_, *ray).closest_hit(*ray, blocks, count, tnear, best);
  }
  bool any_hit(RayData ray, const std::byte* blocks, unsigned count, float tnear, float tfar) const {
    return PlacedLeaves(*blocks_, *ray).any_hit(*ray, blocks, count, tnear, tfar);
  }
  /// Their hits are finished when they have met all instances.
  void finish(RayData, NearestHit&) const {}

  /// As test_leaf().
  template <bool AnyHit, class Counting, class RayAt, class DataOf, class BestOf, class OnHit>
  void test_many(const LeafForm& form, const Counting& counting, const std::byte* blocks, unsigned count,
                 std::uint64_t rays, const RayAt& ray, const DataOf& data, const BestOf& best, const OnHit& hit) const {
    if constexpr (Counting::kCounting) {
      for (int k = __builtin_popcountll(rays); k > 0; --k) counting.leaf(form, blocks, AnyHit ? 0 : count);
    }
    std::uint64_t nearer = 0;
    const std::byte* block = blocks;
    blocks_->any_of(blocks, count, [&](const std::byte* flat) {
      for (std::uint64_t rest = rays; rest; rest &= rest - 1) {
        const int i = __builtin_ctzll(rest);
        if constexpr (Counting::kCounting && AnyHit) counting.blocks(form, block, 1);
        const Ray& r = ray(i);
        if (AnyHit ? blocks_->any_hit(*data(i), flat, r.tnear, r.tfar)
                   : blocks_->closest_hit(*data(i), flat, r.tnear, best(i)))
          nearer |= rest & -rest;
      }
      block += form.bytes;
      if constexpr (AnyHit) {
        for (std::uint64_t met = nearer & rays; met; met &= met - 1) hit(__builtin_ctzll(met));
        rays &= ~nearer;
      }
      return rays == 0;
    });
    if constexpr (!AnyHit) {
      for (; nearer; nearer &= nearer - 1) hit(__builtin_ctzll(nearer));
    }
  }

 private:
  PlacedBlocks* blocks_;
  const PlacedGroup* group_;
};

/// Of a structure whose packets take groups: the search of all rays of `group`. `row` is that of two_level.
template <class Counting>
using PlacedPackets = void (*)(const Accel& below, const KernelRow& row, PlacedBlocks& blocks, PlacedGroup& group,
                               const Counting& counting);

/// nullptr for other structures. W rays a register.
template <int W, bool AnyHit, class Counting>
PlacedPackets<Counting> find_packets(std::string_view below) {
  PlacedPackets<Counting> found = nullptr;
  for_each_type(bvh::Structures{}, [&]<class Tree>(std::type_identity<Tree>) {
    if (Tree::kName != below) return;
    found = [](const Accel& accel, const KernelRow& row, PlacedBlocks& blocks, PlacedGroup& group,
               const Counting& counting) {
      const auto& tree = static_cast<const Tree&>(accel);
      BvhPackets<SoaPacketNodes<Tree::kBranching>, W, PlacedGroupLeaves, AnyHit, Counting> packet(
          tree, row, counting, PlacedGroupLeaves(blocks, group), row.box == "padded",
          tree.max_coordinate() + group.pad);
      packet.set_size(group.count);
      if constexpr (Counting::kCounting) packet.set_width(unsigned(W));
      packet.trace(RayBatch(group.ray, std::size_t(group.count)), group.threshold);
      for (int i = 0; i < group.count; ++i) group.best[i] = packet.best(i);
    };
  });
  return found;
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
