// Leaf blocks: M triangles, as structure of arrays but for one, in the forms that intersectors read.
//
//   triangleM  (EdgeBlock):   first vertex, e1 = v0 - v1, e2 = v2 - v0; the edges are rounded, once, to float.
//   triangleMv (VertexBlock): the three vertices as they are, what the crack-free intersectors need.
//   triangleMi (IndexBlock):  the indices of the three vertices in the mesh: 16 bytes a triangle instead of 40, one
//     look-up more.
//   triangleMw (TransformBlock), triangleMh (PlaneBlock), triangleMp (ProjectionBlock): what baldwin_weber, havel_herout
//     and wald_projection precompute (intersectors/precomputed.h), 48, 48 and 40 bytes a triangle beside the id.
//   triangle4a (AosBlock): triangle4 as array of structures.
//
// A lane without a triangle, or with one of exactly zero area, holds NaN coordinates (every comparison false: never
// hit); without a triangle its id is kNoPrimitive. Among indices an empty lane repeats the block's first triangle, id
// included, which changes no answer.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <new>
#include <span>
#include <string_view>
#include <type_traits>
#include <vector>

#include "core/mesh.h"
#include "core/ray.h"
#include "core/type_list.h"
#include "core/zero_area.h"
#include "intersectors/precomputed.h"

namespace arboretum {

/// How a block keeps its triangles; an intersector says which it can read.
enum class TriangleForm { edges, vertices, indices, transform, planes, projection, array_of_structures };

template <int M>
struct alignas(8) EdgeBlock {
  static constexpr int kWidth = M;
  static constexpr TriangleForm kForm = TriangleForm::edges;
  static constexpr std::string_view kName = M == 1   ? "triangle1"
                                            : M == 4 ? "triangle4"
                                            : M == 8 ? "triangle8"
                                                     : "triangle16";
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
  static constexpr std::string_view kName = M == 1   ? "triangle1v"
                                            : M == 4 ? "triangle4v"
                                            : M == 8 ? "triangle8v"
                                                     : "triangle16v";
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

/// One cache line for four triangles. An empty lane repeats lane 0.
template <int M>
struct alignas(8) IndexBlock {
  static constexpr int kWidth = M;
  static constexpr TriangleForm kForm = TriangleForm::indices;
  static constexpr std::string_view kName = M == 1   ? "triangle1i"
                                            : M == 4 ? "triangle4i"
                                            : M == 8 ? "triangle8i"
                                                     : "triangle16i";
  std::uint32_t vertex[3][M];
  std::uint32_t id[M];
};

/// Twelve numbers a triangle: unit_triangle_transform() or barycentric_planes().
template <int M, TriangleForm Form>
struct alignas(8) TwelveNumberBlock {
  static constexpr int kWidth = M;
  static constexpr TriangleForm kForm = Form;
  static constexpr bool kTransform = Form == TriangleForm::transform;
  static constexpr std::string_view kName = M == 1   ? (kTransform ? "triangle1w" : "triangle1h")
                                            : M == 4 ? (kTransform ? "triangle4w" : "triangle4h")
                                            : M == 8 ? (kTransform ? "triangle8w" : "triangle8h")
                                                     : (kTransform ? "triangle16w" : "triangle16h");
  float number[12][M];
  std::uint32_t id[M];

  void set(int lane, const std::array<Vec3f, 3>& corner, std::uint32_t primitive) noexcept {
    const std::array<float, 12> numbers = kTransform ? unit_triangle_transform(corner) : barycentric_planes(corner);
    for (std::size_t i = 0; i < numbers.size(); ++i) number[i][lane] = numbers[i];
    id[lane] = primitive;
  }
};
template <int M>
using TransformBlock = TwelveNumberBlock<M, TriangleForm::transform>;
template <int M>
using PlaneBlock = TwelveNumberBlock<M, TriangleForm::planes>;

/// A ProjectedTriangle in each lane.
template <int M>
struct alignas(8) ProjectionBlock {
  static constexpr int kWidth = M;
  static constexpr TriangleForm kForm = TriangleForm::projection;
  static constexpr std::string_view kName = M == 1   ? "triangle1p"
                                            : M == 4 ? "triangle4p"
                                            : M == 8 ? "triangle8p"
                                                     : "triangle16p";
  float number[9][M];
  std::int32_t axis[M];
  std::uint32_t id[M];

  void set(int lane, const std::array<Vec3f, 3>& corner, std::uint32_t primitive) noexcept {
    const ProjectedTriangle projected = projected_triangle(corner);
    for (std::size_t i = 0; i < projected.number.size(); ++i) number[i][lane] = projected.number[i];
    axis[lane] = projected.axis;
    id[lane] = primitive;
  }
};

/// Four triangles as array of structures, the leaf of the kernels for Intel's MIC architecture (Benthin, Wald, Woop,
/// Ernst, Mark 2012; Woop, Benthin, Wald 2013): a 16-lane register holds the first vertex, or an edge, of all four. Ids
/// stand apart, since as a vector's fourth lane they would be subnormal numbers, which are slow to reckon with.
struct alignas(8) AosBlock {
  static constexpr int kWidth = 4;
  static constexpr TriangleForm kForm = TriangleForm::array_of_structures;
  static constexpr std::string_view kName = "triangle4a";
  float v0[4][4];  ///< x y z 0 of each triangle
  float e1[4][4];  ///< v0 - v1
  float e2[4][4];  ///< v2 - v0
  std::uint32_t id[4];

  void set(int lane, const std::array<Vec3f, 3>& corner, std::uint32_t primitive) noexcept {
    const auto store = [lane](float(&rows)[4][4], Vec3f p) {
      rows[lane][0] = p.x, rows[lane][1] = p.y, rows[lane][2] = p.z, rows[lane][3] = 0.0f;
    };
    store(v0, corner[0]), store(e1, corner[0] - corner[1]), store(e2, corner[2] - corner[0]);
    id[lane] = primitive;
  }
};

/// A block of each width.
template <template <int> class Block>
using EveryWidth = TypeList<Block<1>, Block<4>, Block<8>, Block<16>>;

/// Every leaf block that there is.
using AllBlocks =
    ConcatLists<EveryWidth<EdgeBlock>, EveryWidth<VertexBlock>, EveryWidth<IndexBlock>, EveryWidth<TransformBlock>,
                EveryWidth<PlaneBlock>, EveryWidth<ProjectionBlock>, TypeList<AosBlock>>;

/// Bytes that hold any of them.
template <class... Blocks>
constexpr std::size_t largest_of(TypeList<Blocks...>) {
  std::size_t most = 0;
  ((most = sizeof(Blocks) > most ? sizeof(Blocks) : most), ...);
  return most;
}
inline constexpr std::size_t kLargestBlock = largest_of(AllBlocks{});
/// Triangles that the widest holds.
template <class... Blocks>
constexpr int widest_of(TypeList<Blocks...>) {
  int most = 0;
  ((most = Blocks::kWidth > most ? Blocks::kWidth : most), ...);
  return most;
}
inline constexpr int kWidestBlock = widest_of(AllBlocks{});

/// Calls f with the std::type_identity of the block of that key; false where there is none.
template <class F>
bool with_block(std::string_view leaf, F&& f) {
  bool found = false;
  for_each_type(AllBlocks{}, [&]<class Block>(std::type_identity<Block> block) {
    if (Block::kName == leaf) found = true, f(block);
  });
  return found;
}

/// The blocks that make sense on an instruction set of W-lane registers, W = 1 for scalar: no wider than two registers,
/// sixteen only where one register holds them.
template <template <int> class Block, int W>
using BlocksOfWidth = std::conditional_t<W == 1, TypeList<Block<1>, Block<4>>,
                                         std::conditional_t<W == 16, TypeList<Block<1>, Block<4>, Block<8>, Block<16>>,
                                                            TypeList<Block<1>, Block<4>, Block<8>>>>;

/// Writes the triangles `ids` of the mesh (1 to M of them) into a block and marks the other lanes empty.
template <class Block>
void fill_block(Block& block, const TriangleMesh& mesh, std::span<const std::uint32_t> ids) noexcept {
  const int count = int(ids.size());
  if constexpr (Block::kForm == TriangleForm::indices) {
    for (int i = 0; i < Block::kWidth; ++i) {
      const std::uint32_t id = ids[std::size_t(i < count ? i : 0)];
      const Triangle t = mesh.triangles[id];
      block.vertex[0][i] = t.a, block.vertex[1][i] = t.b, block.vertex[2][i] = t.c;
      block.id[i] = id;
    }
  } else {
    constexpr float nan = std::numeric_limits<float>::quiet_NaN();
    constexpr Vec3f none{nan, nan, nan};
    for (int i = 0; i < count; ++i) {
      const std::uint32_t id = ids[std::size_t(i)];
      const std::array<Vec3f, 3> corner = mesh.corners(id);
      if (has_zero_area(corner[0], corner[1], corner[2])) {
        block.set(i, {none, none, none}, id);
      } else {
        block.set(i, corner, id);
      }
    }
    for (int i = count; i < Block::kWidth; ++i) block.set(i, {none, none, none}, kNoPrimitive);
  }
}

/// Blocks for the triangles `ids`: the last one may have empty lanes.
template <class Block>
void fill_blocks(Block* block, const TriangleMesh& mesh, std::span<const std::uint32_t> ids) noexcept {
  for (; !ids.empty(); ++block) {
    const std::size_t count = ids.size() < std::size_t(Block::kWidth) ? ids.size() : std::size_t(Block::kWidth);
    fill_block(*new (block) Block, mesh, ids.first(count));
    ids = ids.subspan(count);
  }
}

/// How many triangles a block holds.
template <class Block>
[[nodiscard]] int triangles_in(const Block& block) noexcept {
  const std::uint32_t empty = Block::kForm == TriangleForm::indices ? block.id[0] : kNoPrimitive;
  int count = Block::kWidth;
  while (count > 1 && block.id[count - 1] == empty) --count;
  return count;
}

/// The triangles of `blocks` consecutive blocks, appended to `out`.
template <class Block>
void append_primitives(const Block* block, unsigned blocks, std::vector<std::uint32_t>& out) {
  for (const Block* end = block + blocks; block != end; ++block)
    out.insert(out.end(), block->id, block->id + triangles_in(*block));
}

}  // namespace arboretum
