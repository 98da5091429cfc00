// Leaf blocks: M triangles as structure of arrays, in the two forms that intersectors read.
//
// triangleM  (EdgeBlock):   first vertex, e1 = v0 - v1, e2 = v2 - v0; the edges are rounded, once, to float.
// triangleMv (VertexBlock): the three vertices as they are, what the crack-free intersectors need.
// A lane without a triangle holds NaN coordinates (every comparison false: never hit) and kNoPrimitive.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string_view>
#include <type_traits>

#include "core/mesh.h"
#include "core/ray.h"
#include "core/type_list.h"

namespace arboretum {

/// How a block keeps its triangles; an intersector says which it can read.
enum class TriangleForm { edges, vertices };

template <int M>
struct alignas(8) EdgeBlock {
  static constexpr int kWidth = M;
  static constexpr TriangleForm kForm = TriangleForm::edges;
  static constexpr std::string_view kName =
      M == 1 ? "triangle1" : M == 4 ? "triangle4" : M == 8 ? "triangle8" : "triangle16";
  float v0[3][M];
  float e1[3][M];  ///< v0 - v1
  float e2[3][M];  ///< v2 - v0
  std::uint32_t id[M];

  void set(int lane, const std::array<Vec3f, 3>& corner, std::uint32_t primitive) noexcept {
    for (int axis = 0; axis < 3; ++axis) {
      v0[axis][lane] = corner[0][axis];
      e1[axis][lane] = corner[0][axis] - corner[1][axis];
      e2[axis][lane] = corner[2][axis] - corner[0][axis];
    }
    id[lane] = primitive;
  }
};

template <int M>
struct alignas(8) VertexBlock {
  static constexpr int kWidth = M;
  static constexpr TriangleForm kForm = TriangleForm::vertices;
  static constexpr std::string_view kName =
      M == 1 ? "triangle1v" : M == 4 ? "triangle4v" : M == 8 ? "triangle8v" : "triangle16v";
  float v0[3][M];
  float v1[3][M];
  float v2[3][M];
  std::uint32_t id[M];

  void set(int lane, const std::array<Vec3f, 3>& corner, std::uint32_t primitive) noexcept {
    for (int axis = 0; axis < 3; ++axis) {
      v0[axis][lane] = corner[0][axis];
      v1[axis][lane] = corner[1][axis];
      v2[axis][lane] = corner[2][axis];
    }
    id[lane] = primitive;
  }
};

/// The blocks that make sense on an instruction set of W-lane registers, W = 1 for scalar: no wider than two registers,
/// sixteen only where one register holds them.
template <template <int> class Block, int W>
using BlocksOfWidth = std::conditional_t<W == 1, TypeList<Block<1>, Block<4>>,
                                         std::conditional_t<W == 16, TypeList<Block<1>, Block<4>, Block<8>, Block<16>>,
                                                            TypeList<Block<1>, Block<4>, Block<8>>>>;

/// Writes `count` triangles (at most M) into a block and marks the other lanes empty. `corners(i)` gives the i-th
/// triangle's three vertices, `primitive(i)` its id.
template <class Block, class Corners, class Primitive>
void fill_block(Block& block, int count, Corners&& corners, Primitive&& primitive) noexcept {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  constexpr Vec3f none{nan, nan, nan};
  for (int i = 0; i < count; ++i) block.set(i, corners(i), primitive(i));
  for (int i = count; i < Block::kWidth; ++i) block.set(i, {none, none, none}, kNoPrimitive);
}

}  // namespace arboretum
