// What packets through structures with shared leaves (leaf_lists.h) have in common: leaves by their code, and rays that
// go on alone.
#pragma once

#include "structures/leaves/leaf_lists.h"
#include "traversal/packet_leaves.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <int W, class Leaves, bool AnyHit, class Counting, class Rays>
class ListedPacketLeaves : protected PacketLeaves<W, Leaves, AnyHit, Counting, Rays> {
  using Base = PacketLeaves<W, Leaves, AnyHit, Counting, Rays>;

 public:
  using Base::best, Base::set_width, Base::times_alone;
  using typename Base::Mask;

 protected:
  ListedPacketLeaves(const KernelRow& row, const LeafStore& store, Counting counting)
      : Base(row, Leaves(row, store.vertices()), counting), store_(store) {}

  /// Leaves are new to all rays again.
  void forget_leaves() { std::fill(std::begin(last_leaf_), std::end(last_leaf_), kEmptyLeaf); }
  /// The rays of `mask` that do not come from a leaf of that code: neighbouring cells may share one.
  ARBORETUM_INLINE Mask new_to(LeafCode code, Mask mask) {
    const vi<W> here{std::int32_t(code)};
    Mask rays = 0;
    for (int c = 0; c < Base::chunks_; ++c) {
      const unsigned in = Base::lanes_of(mask, c);
      if (in == 0) continue;
      const vi<W> last = vi<W>::load(last_leaf_ + c * W);
      rays |= Mask(~(last == here).bits() & in) << (c * W);
      select(vm<W>::from_bits(in), here, last).store(last_leaf_ + c * W);
    }
    return rays;
  }

  void leaf(LeafCode code, Mask mask) {
    const LongLeaf range = store_.range(code);
    Base::leaf(blocks_of(range), range.blocks, mask);
  }

  /// As PacketLeaves' own; search(i, visits) calls visits(code) for leaves.
  template <class Search>
  void go_on_alone(Mask mask, const Search& search) {
    Base::go_on_alone(mask, [&](int i, auto& ray) {
      const Ray& r = Base::rays_[i];
      auto visits = [&](LeafCode code) {
        const LongLeaf range = store_.range(code);
        if constexpr (AnyHit)
          return any_hit_in_leaf(Base::leaves_, ray, Base::form_, Base::counting_, blocks_of(range), range.blocks,
                                 r.tnear, r.tfar);
        Base::counting_.leaf(Base::form_, blocks_of(range), range.blocks);
        Base::leaves_.closest_hit(ray, blocks_of(range), range.blocks, r.tnear, Base::best_[i]);
        return false;
      };
      return search(i, visits);
    });
  }

 private:
  ARBORETUM_INLINE const std::byte* blocks_of(LongLeaf range) const {
    return store_.blocks() + range.first * Base::leaves_.block_bytes();
  }

  const LeafStore& store_;

 protected:
  alignas(64) LeafCode last_leaf_[Base::kMost];  ///< of each ray (new_to())
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
