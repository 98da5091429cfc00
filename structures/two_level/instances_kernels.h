// The instances as leaves (traversal/leaves.h) of two_level's top: a ray or a packet that meets one is mapped into its
// object space and goes through the structure below.
#pragma once

#include "structures/two_level/placed_leaves_packet.h"
#include "structures/two_level/placed_search_single.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Of the top only nodes are counted: its leaves are what is below.
template <class Counting>
struct TopCounting : Counting {
  explicit TopCounting(const Counting& counting) : Counting(counting) {}
  void leaf(const LeafForm&, const std::byte*, unsigned) const noexcept {}
  void blocks(const LeafForm&, const std::byte*, unsigned) const noexcept {}
  void share_leaf(unsigned) const noexcept {}
};

template <class Counting>
class InstanceLeaves {
 public:
  struct RayData {
    PreparedRay prepared;
    const Ray* world;
  };
  static constexpr bool kRaysInLanes = false, kBlockByBlock = false, kMany = true;

  InstanceLeaves(const two_level::TwoLevel& accel, const KernelRow& row, Counting counting)
      : accel_(&accel), row_(&row), blocks_(*row.tests, accel.mesh()), counting_(counting) {
    const auto set = [this](auto padded) {
      closest_ = find_search<false, decltype(padded)::value, Counting>(accel_->below());
      any_ = find_search<true, decltype(padded)::value, Counting>(accel_->below());
    };
    row.box == "padded" ? set(std::true_type{}) : set(std::false_type{});
  }
  /// Packets go on as such in the structure below where there are `packets` for it. `group` is where, one instance
  /// after the other.
  InstanceLeaves(const two_level::TwoLevel& accel, const KernelRow& row, Counting counting,
                 PlacedPackets<Counting> packets, PlacedGroup& group)
      : InstanceLeaves(accel, row, counting) {
    packets_ = packets, group_ = &group;
  }

  RayData prepare(const Ray& ray) const {
    RayData data;
    blocks_.tests().prepare(ray, data.prepared), data.world = &ray;
    return data;
  }
  bool closest_hit(RayData& data, const std::byte* leaf, unsigned /*count*/, float /*tnear*/, NearestHit& best) const {
    search<false>(data, instance_of(leaf), best);
    return true;
  }
  bool any_hit(RayData& data, const std::byte* leaf, unsigned /*count*/, float /*tnear*/, float tfar) const {
    NearestHit best{tfar};
    return search<true>(data, instance_of(leaf), best);
  }
  void finish(RayData& data, NearestHit& best) const {
    if (blocks_.tests().finish && best.primitive != NearestHit::kNone) blocks_.tests().finish(data.prepared, best);
  }

  /// As test_leaf().
  template <bool AnyHit, class RayAt, class DataOf, class BestOf, class OnHit>
  void test_many(const LeafForm&, const TopCounting<Counting>&, const std::byte* leaf, unsigned /*count*/,
                 std::uint64_t rays, const RayAt& ray, const DataOf& data, const BestOf& best, const OnHit& hit) const {
    const two_level::Placed& instance = instance_of(leaf);
    PlacedGroup& group = *group_;
    group.count = 0, group.pad = 0.0f;
    const bool together = packets_ && __builtin_popcountll(rays) > group.threshold;
    for (; rays; rays &= rays - 1) {
      const int i = __builtin_ctzll(rays);
      const PlacedRay placed(ray(i), instance, best(i).t);
      if (together && placed.pad < std::numeric_limits<float>::infinity()) {
        group.ray[group.count] = placed, group.prepared[group.count] = &data(i).prepared;
        group.best[group.count] = best(i), group.number[group.count] = i;
        ++group.count, group.pad = std::max(group.pad, placed.pad);
      } else if (search<AnyHit>(data(i), instance, placed, best(i)) || !AnyHit) {
        hit(i);
      }
    }
    if (group.count == 0) return;
    blocks_.enter(instance);
    packets_(*instance.below, *row_, blocks_, group, counting_);
    for (int k = 0; k < group.count; ++k) {
      const int i = group.number[k];
      if constexpr (!AnyHit) best(i) = group.best[k];
      if (!AnyHit || group.best[k].primitive != NearestHit::kNone) hit(i);
    }
  }

 private:
  [[nodiscard]] const two_level::Placed& instance_of(const std::byte* leaf) const {
    return accel_->placed()[reinterpret_cast<const IndexBlock<1>*>(leaf)->id[0]];
  }
  template <bool AnyHit>
  bool search(RayData& data, const two_level::Placed& instance, NearestHit& best) const {
    return search<AnyHit>(data, instance, PlacedRay(*data.world, instance, best.t), best);
  }
  template <bool AnyHit>
  bool search(RayData& data, const two_level::Placed& instance, const PlacedRay& placed, NearestHit& best) const {
    blocks_.enter(instance);
    return (AnyHit ? any_ : closest_)(*instance.below, placed, PlacedLeaves(blocks_, data.prepared), best, counting_);
  }

  const two_level::TwoLevel* accel_;
  const KernelRow* row_;
  mutable PlacedBlocks blocks_;
  Counting counting_;
  PlacedSearch<Counting> closest_ = nullptr, any_ = nullptr;
  PlacedPackets<Counting> packets_ = nullptr;
  PlacedGroup* group_ = nullptr;
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
