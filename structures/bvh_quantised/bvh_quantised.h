// bvh4_quantised, bvh8_quantised: wide BVHs whose child boxes have 8 bits a plane, on a grid of the node's own with
// power-of-two steps (Ylitie, Karras, Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs",
// section 3). Unlike there, references stay 32 bits each: a node of eight is 96 bytes with them, in multiples of 32 as
// references count, and would be with less.
//
// Conservative: a plane stands for origin + q * step, exactly, and q is chosen so that the exact value is not above a child's lower
// and not below its upper plane. A test that rounds that sum to float keeps the property, since rounding is monotonous and the
// child's plane is a float; a test with FMA computes from the exact value (bvh_quantised_kernels.h).
#pragma once

#include <cstdint>

#include "structures/bvh/bvh.h"

namespace arboretum::bvh_quantised {

/// 64 bytes for N = 4, 96 for N = 8, two cache lines at most. Children come first.
template <int N>
struct alignas(N == 4 ? 64 : 32) Node {
  float origin[3];
  std::uint8_t exponent[3];  ///< step = 2^(exponent - 127) along each axis; 1 .. 254
  std::uint8_t children;     ///< a bit for each child that there is
  std::uint8_t planes[6][N]; ///< [2 * axis + side][child], side 0 lower, 1 upper
  bvh::NodeReference child[N];
};
static_assert(sizeof(Node<4>) == 64 && sizeof(Node<8>) == 96);

/// A node's grid along one axis.
struct Grid {
  float origin;
  std::uint8_t exponent;
};

/// The grid with the smallest step whose 256 planes span [lower, upper]. Takes any finite lower <= upper.
[[nodiscard]] Grid grid_over(float lower, float upper) noexcept;
/// The last plane not above `x`, and the first not below it, for an x within what the grid spans. Exact: no rounding moves a plane to
/// the other side of x. On a grid wider than floats reach (more than 2^128), plane_below stays where q * step is finite.
[[nodiscard]] std::uint8_t plane_below(const Grid& grid, float x) noexcept;
[[nodiscard]] std::uint8_t plane_above(const Grid& grid, float x) noexcept;
/// origin + q * step, rounded to float.
[[nodiscard]] float plane_of(const Grid& grid, std::uint8_t q) noexcept;

template <int N>
struct QuantisedNodes {
  static constexpr int kBranching = N;
  static constexpr std::string_view kName = N == 4 ? "bvh4_quantised" : "bvh8_quantised";
  static constexpr std::string_view kSummary = N == 4 ? "4-wide bounding volume hierarchy, child boxes in 8 bits a plane: 64-byte nodes"
                                                      : "8-wide bounding volume hierarchy, child boxes in 8 bits a plane: 96-byte nodes";
  static constexpr std::size_t kGranule = N == 4 ? 64 : 32;
  using Node = bvh_quantised::Node<N>;

  static void write(Node& node, const Bounds3f* boxes, const bvh::NodeReference* references, unsigned count) noexcept;
  /// The boxes as rays meet them: dequantised.
  static unsigned read(const Node& node, Bounds3f* boxes, bvh::NodeReference* references) noexcept;
};

using Bvh4Quantised = bvh::WideBvh<QuantisedNodes<4>>;
using Bvh8Quantised = bvh::WideBvh<QuantisedNodes<8>>;
using Structures = TypeList<Bvh4Quantised, Bvh8Quantised>;

}  // namespace arboretum::bvh_quantised
