// What packets keep of rays in lanes that meet triangles, as `exact` knows it (exact.h).
#pragma once

#include <cstddef>
#include <cstring>

#include "intersectors/leaf_block.h"
#include "intersectors/round_later.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {
namespace exact_filter {

/// What W rays of a packet make of one triangle: it is within what counts for the `hit` ones, at a t within their
/// [low, high]; the filter cannot say for those of `again`, which have to be tested alone.
template <int W>
struct FilteredRays {
  unsigned hit, again;
  vf<W> low, high;
};

/// The nearest hits of a packet's rays (traversal/packet_leaves.h): of the interval of each the low end, the high one
/// being the packet's t, and its triangle, whose block stays where it is.
template <class Block>
class PacketHits {
 public:
  template <int W>
  ARBORETUM_INLINE void start(int k, vf<W> tfar) {
    tfar.store(low_ + k);
  }
  /// Of the rays that triangle i of a block certainly hits no farther than their t, `found.hit`, those for which it
  /// is certainly the nearest so far; sets their t.
  template <int W>
  ARBORETUM_INLINE unsigned take(int k, const FilteredRays<W>& found, const Block& block, int i, float* t) {
    using F = vf<W>;
    const F low = F::load(low_ + k);
    const vm<W> nearer = vm<W>::from_bits(found.hit) & (found.high < low);
    select(nearer, found.low, low).store(low_ + k), select(nearer, found.high, F::load(t + k)).store(t + k);
    const auto address = reinterpret_cast<std::uintptr_t>(&block.v0[0][i]);
    const auto put = [nearer](std::uint32_t* to, std::uint32_t half) {
      select(nearer, vi<W>(std::int32_t(half)), vi<W>::load(to)).store(to);
    };
    put(first_[0] + k, std::uint32_t(address)), put(first_[1] + k, std::uint32_t(std::uint64_t(address) >> 32));
    return nearer.bits();
  }
  [[nodiscard]] ARBORETUM_INLINE NearestHit at(int i, float t) const {
    std::int32_t id;
    std::memcpy(&id, first(i) + (offsetof(Block, id) - offsetof(Block, v0)) / sizeof(float), sizeof id);
    return {t, 0.0f, 0.0f, id};
  }
  [[nodiscard]] ARBORETUM_INLINE CornersInFours corners(int i) const {
    return CornersInFours::of_rows([p = first(i)](int row) { return p[row * Block::kWidth]; });
  }
  /// What ray i has met so far, for its search to go on alone; and what it has met there, once it is back.
  ARBORETUM_INLINE void bring(int i, auto& ray) const {
    ray.has_best = true, ray.best = corners(i), ray.best_low = low_[i];
  }
  ARBORETUM_INLINE void take_back(int i, const auto& ray) { low_[i] = ray.best_low; }

 private:
  static_assert(offsetof(Block, v1) == offsetof(Block, v0) + 3 * sizeof(float[Block::kWidth]) &&
                offsetof(Block, v2) == offsetof(Block, v1) + 3 * sizeof(float[Block::kWidth]) &&
                sizeof Block::id == sizeof(float[Block::kWidth]));
  /// The first coordinate of ray i's triangle; the others follow, a row of the block apart.
  [[nodiscard]] ARBORETUM_INLINE const float* first(int i) const {
    return reinterpret_cast<const float*>(std::uintptr_t(first_[0][i] | std::uint64_t(first_[1][i]) << 32));
  }

  alignas(64) float low_[PacketRays::kMost];
  alignas(64) std::uint32_t first_[2][PacketRays::kMost];  ///< the halves of its address
};

}  // namespace exact_filter
}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
