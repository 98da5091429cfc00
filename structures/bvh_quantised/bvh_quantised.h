// bvh4_quantised, bvh8_quantised: wide BVHs whose child boxes have 10 bits a plane, on a grid of the node's own with
// power-of-two steps (Ylitie, Karras, Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide
// BVHs", section 3, where a plane has 8 bits). References stay 32 bits each.
//
// Lower planes of x, y and z stand in one 32-bit word a child, upper ones in another: a plane is one `and` away from an
// integer, which is q times 2^0, 2^10 or 2^20. The step is kept divided by the same power, so that nothing is shifted.
//
// Conservative: a plane stands for origin + q * step, exactly, and q is chosen so that the exact value is not above a
// child's lower and not below its upper plane. A test that rounds that sum to float keeps the property, since rounding
// is monotonous and the child's plane is a float.
#pragma once

#include <cstdint>

#include "structures/bvh/bvh.h"

namespace arboretum::bvh_quantised {

/// Where an axis' bits stand in a word of planes.
inline constexpr unsigned kPlaneBits = 10, kMostPlane = (1u << kPlaneBits) - 1;
[[nodiscard]] constexpr unsigned plane_shift(unsigned axis) noexcept { return kPlaneBits * axis; }
[[nodiscard]] constexpr std::uint32_t plane_mask(unsigned axis) noexcept { return kMostPlane << plane_shift(axis); }

/// 128 bytes for N = 8, 64 for N = 4: whole cache lines. Children come first.
template <int N>
struct NodeHead {
  float origin[3];
  std::uint8_t children;  ///< a bit for each child that there is
  std::uint8_t filler[3];
  float step[4];  ///< 2^(-10 axis) times the grid's step; the last fills a line
};
template <>
struct NodeHead<4> {
  float origin[3];
  std::uint8_t exponent[3];  ///< of those steps: step = 2^(exponent - 127)
  std::uint8_t children;
};
template <int N>
struct alignas(64) Node : NodeHead<N> {
  std::uint32_t planes[2][N];  ///< [side][child], side 0 lower, 1 upper; x in the lowest ten bits, then y, then z
  bvh::NodeReference child[N];

  [[nodiscard]] unsigned plane(unsigned axis, unsigned side, unsigned i) const noexcept {
    return planes[side][i] >> plane_shift(axis) & kMostPlane;
  }
};
static_assert(sizeof(Node<4>) == 64 && sizeof(Node<8>) == 128);

/// A node's grid along one axis: step = 2^(exponent - 127), exponent 21 .. 254, so that 2^-20 steps are no subnormal
/// number.
struct Grid {
  float origin;
  std::uint8_t exponent;
};

/// The grid with the smallest step whose 1024 planes span [lower, upper]. Takes any finite lower <= upper.
[[nodiscard]] Grid grid_over(float lower, float upper) noexcept;
/// The last plane not above `x`, and the first not below it, for an x within what the grid spans. Exact: no rounding
/// moves a plane to the other side of x. On a grid wider than floats reach (more than 2^128), plane_below stays where q
/// * step is finite.
[[nodiscard]] unsigned plane_below(const Grid& grid, float x) noexcept;
[[nodiscard]] unsigned plane_above(const Grid& grid, float x) noexcept;
/// origin + q * step, rounded to float.
[[nodiscard]] float plane_of(const Grid& grid, unsigned q) noexcept;
/// That of a node.
template <int N>
[[nodiscard]] Grid grid_of(const Node<N>& node, int axis) noexcept;

template <int N>
struct QuantisedNodes {
  static constexpr int kBranching = N;
  static constexpr std::string_view kName = N == 4 ? "bvh4_quantised" : "bvh8_quantised";
  static constexpr std::string_view kSummary =
      N == 4 ? "4-wide bounding volume hierarchy, child boxes in 10 bits a plane: 64-byte nodes"
             : "8-wide bounding volume hierarchy, child boxes in 10 bits a plane: 128-byte nodes";
  static constexpr std::size_t kGranule = 64;
  using Node = bvh_quantised::Node<N>;

  static void write(Node& node, const Bounds3f* boxes, const bvh::NodeReference* references, unsigned count) noexcept;
  /// The boxes as rays meet them: dequantised.
  static unsigned read(const Node& node, Bounds3f* boxes, bvh::NodeReference* references) noexcept;
};

using Bvh4Quantised = bvh::WideBvh<QuantisedNodes<4>>;
using Bvh8Quantised = bvh::WideBvh<QuantisedNodes<8>>;
using Structures = TypeList<Bvh4Quantised, Bvh8Quantised>;

}  // namespace arboretum::bvh_quantised
