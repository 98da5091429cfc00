// What packets through structures with shared leaves (leaf_lists.h) have in common: leaves by their code, and rays that go on alone.
#pragma once

#include "structures/leaves/leaf_lists.h"
#include "traversal/packet_leaves.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <int W, class Leaves, bool AnyHit, class Counting, class Rays>
class ListedPacketLeaves : protected PacketLeaves<W, Leaves, AnyHit, Counting, Rays> {
  using Base = PacketLeaves<W, Leaves, AnyHit, Counting, Rays>;

 public:
  using Base::best;
  using typename Base::Mask;
  /// Of all packets so far, how often a ray went on alone.
  [[nodiscard]] std::size_t times_alone() const { return times_alone_; }

 protected:
  ListedPacketLeaves(const KernelRow& row, const LeafStore& store, Counting counting) : Base(row, store.vertices(), counting), store_(store) {}

  void leaf(LeafCode code, Mask mask) {
    const LongLeaf range = store_.range(code);
    Base::leaf(blocks_of(range), range.blocks, mask);
  }

  /// The rays of `mask` leave the packet: search(i, visits) is ray i's search of what is left, as single rays' search, and returns whether it is occluded.
  template <class Search>
  void go_on_alone(Mask mask, const Search& search) {
    const auto count = unsigned(__builtin_popcountll(mask));
    times_alone_ += count;
    if constexpr (Counting::kCounting) ++Base::counting_.counters.switches, Base::counting_.counters.rays_alone += count;
    for (; mask; mask &= mask - 1) {
      const int i = __builtin_ctzll(mask);
      auto&& ray = Base::data(i);
      NearestHit& best = Base::best_[i];
      const Ray& r = Base::rays_[i];
      auto visits = [&](LeafCode code) {
        const LongLeaf range = store_.range(code);
        Base::counting_.leaf(Base::form_, blocks_of(range), range.blocks);
        if constexpr (AnyHit) return Base::leaves_.any_hit(ray, blocks_of(range), range.blocks, r.tnear, r.tfar);
        Base::leaves_.closest_hit(ray, blocks_of(range), range.blocks, r.tnear, best);
        return false;
      };
      if (search(i, visits)) Base::occluded(i);
      Base::lanes_.t[i] = best.t;
    }
  }

 private:
  ARBORETUM_INLINE const std::byte* blocks_of(LongLeaf range) const { return store_.blocks() + range.first * Base::leaves_.block_bytes(); }

  const LeafStore& store_;
  std::size_t times_alone_ = 0;
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
