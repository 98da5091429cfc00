// What waits for the groups of a stream (bvh_stream.h): a group's stack, and how the children of a node that its rays
// meet come onto it.
#pragma once

#include "simd/lane_order.h"
#include "simd/swizzle.h"
#include "structures/bvh/traversal_stack.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Of up to 64 rays: nodes, the rays that are to visit each, and the least distance at which one of them enters it.
/// Each is an array of its own, so that children can be stored from registers.
struct StreamStack {
  std::uint32_t *low = nullptr, *high = nullptr;  ///< rays 0 to 31, and 32 to 63
  bvh::NodeReference* target = nullptr;
  float* t = nullptr;

  StreamStack() = default;
  /// In `words(entries)` words of memory.
  StreamStack(std::uint32_t* memory, std::size_t entries)
      : low(memory), high(low + stride(entries)), target(high + stride(entries)),
        t(reinterpret_cast<float*>(target + stride(entries))) {}
  [[nodiscard]] static std::size_t words(std::size_t entries) { return 4 * stride(entries); }

  [[nodiscard]] ARBORETUM_INLINE std::uint64_t rays(std::size_t i) const {
    return low[i] | std::uint64_t(high[i]) << 32;
  }

 private:
  /// A register may be stored behind the last entry. Whole cache lines, an odd number: not all arrays begin in the same
  /// sets.
  static std::size_t stride(std::size_t entries) { return ((entries + 16 + 15) / 16 | 1) * 16; }
};

/// Which rays of a group meet which of a node's N children, and the least distances at which they enter them. Rays are
/// bits, children lanes: bytes by ray, read again as a register, would be waited for, since no single store wrote what
/// is read.
template <int N, bool AnyHit>
class MetChildrenInLanes {
  static constexpr int W = lanes_for(N);

 public:
  ARBORETUM_INLINE MetChildrenInLanes() : low_(0), high_(0), least_(std::numeric_limits<float>::infinity()) {}

  /// Ray i, 0 to 63, meets these children, and enters them there.
  ARBORETUM_INLINE void add(unsigned i, vm<W> meets, vf<W> entry) {
    low_ = or_where(meets, low_, vi<W>(kBitOf.half[i][0])), high_ = or_where(meets, high_, vi<W>(kBitOf.half[i][1]));
    if constexpr (!AnyHit) least_ = select(meets, min_x86(entry, least_), least_);
  }

  /// The children that some ray met go onto the stack, whose first `begin` entries stay: the nearest on top, for any
  /// hit as they stand in the node. Returns the new number of entries. Child i's reference is child[i * Stride].
  template <int Stride>
  ARBORETUM_INLINE unsigned push(const StreamStack& stack, unsigned begin, const bvh::NodeReference* child,
                                 std::uint64_t /*rays*/) const {
    const unsigned met = ~((low_ | high_) == vi<W>(0)).bits() & ((1u << N) - 1u),
                   count = unsigned(__builtin_popcount(met));
    const vi<W> children = references<Stride, W>(child);
    if constexpr (AnyHit) {
      compress(met, low_).store(stack.low + begin), compress(met, high_).store(stack.high + begin),
          compress(met, children).store(stack.target + begin);
    } else {
      // Distances are ordered by their bits, the last four of which give way to the lane's number.
      const vi<W> lane =
          sort_first_down(compress(met, (least_.as_int() & vi<W>(~15)) | vi<W>::iota()), count) & vi<W>(15);
      permute(low_, lane).store(stack.low + begin), permute(high_, lane).store(stack.high + begin),
          permute(children, lane).store(stack.target + begin);
      permute(least_.as_int(), lane).store(stack.t + begin);
    }
    return begin + count;
  }

 private:
  struct BitOf {
    std::int32_t half[64][2] = {};
    constexpr BitOf() {
      for (int i = 0; i < 64; ++i) half[i][i / 32] = std::int32_t(std::uint32_t{1} << (i % 32));
    }
  };
  static constexpr BitOf kBitOf{};

  vi<W> low_, high_;  ///< rays 0 to 31 and 32 to 63
  vf<W> least_;
};

/// The same where a register is narrower than a node, or its lanes cannot change places: a bit for each child in a byte
/// by ray.
template <int N, bool AnyHit>
class MetChildrenInBytes {
  static constexpr int W = lanes_for(N), kBytes = (W + 7) / 8;

 public:
  ARBORETUM_INLINE MetChildrenInBytes() : least_(std::numeric_limits<float>::infinity()) {}

  ARBORETUM_INLINE void add(unsigned i, vm<W> meets, vf<W> entry) {
    const unsigned hit = meets.bits() & ((1u << N) - 1u);
    for (int b = 0; b < kBytes; ++b) of_ray_[b][i] = std::uint8_t(hit >> (8 * b));
    any_ |= hit;
    if constexpr (!AnyHit) least_ = select(meets, min_x86(entry, least_), least_);
  }

  template <int Stride>
  ARBORETUM_INLINE unsigned push(const StreamStack& stack, unsigned begin, const bvh::NodeReference* child,
                                 std::uint64_t rays) const {
    const SixtyFourBytes bytes[2] = {SixtyFourBytes(of_ray_[0]), SixtyFourBytes(of_ray_[kBytes - 1])};
    unsigned top = begin;
    const auto put = [&](unsigned i, float t) {
      const std::uint64_t met = bytes[i >> 3].with_bit(int(i & 7u)) & rays;
      stack.low[top] = std::uint32_t(met), stack.high[top] = std::uint32_t(met >> 32),
      stack.target[top] = child[i * unsigned(Stride)], stack.t[top] = t;
      ++top;
    };
    if constexpr (AnyHit) {
      for (unsigned rest = any_; rest; rest &= rest - 1) put(unsigned(__builtin_ctz(rest)), 0.0f);
    } else {
      alignas(64) std::uint32_t t[W];
      least_.store(t);
      std::uint64_t order[W], *end = order;  // distance and child, the farthest first
      for (unsigned rest = any_; rest; rest &= rest - 1) {
        const unsigned i = unsigned(__builtin_ctz(rest));
        const std::uint64_t e = std::uint64_t(t[i]) << 32 | i;
        std::uint64_t* at = end++;
        for (; at != order && at[-1] < e; --at) *at = at[-1];
        *at = e;
      }
      for (const std::uint64_t* e = order; e != end; ++e)
        put(unsigned(*e), __builtin_bit_cast(float, std::uint32_t(*e >> 32)));
    }
    return top;
  }

 private:
  alignas(64) std::uint8_t of_ray_[kBytes][64];
  unsigned any_ = 0;
  vf<W> least_;
};

template <int N, bool AnyHit>
using MetChildren =
    std::conditional_t<kOrdersLanes<lanes_for(N)>, MetChildrenInLanes<N, AnyHit>, MetChildrenInBytes<N, AnyHit>>;

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
