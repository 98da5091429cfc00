// Filling blocks of edges or vertices four triangles at a time: the same blocks as fill_blocks(), bit for bit. Written
// once for all instruction sets: SSE2 is in every x86-64.
#pragma once

#include <emmintrin.h>

#include "intersectors/blocks.h"
#include "structures/builders/box4.h"
#include "structures/leaves/block_padding.h"

namespace arboretum {

template <class Block>
inline constexpr bool kFillsByFours =
    (Block::kForm == TriangleForm::edges || Block::kForm == TriangleForm::vertices) && Block::kWidth % 4 == 0;

/// Lanes whose points are clearly not collinear in the plane. In float, so fewer than clearly_not_collinear() finds:
/// the same bound for this precision, and what products lose by underflow. NaN and overflow count as not clear.
[[nodiscard]] inline __m128 clearly_not_collinear(__m128 ax, __m128 ay, __m128 bx, __m128 by, __m128 cx,
                                                  __m128 cy) noexcept {
  const __m128 left = _mm_mul_ps(_mm_sub_ps(bx, ax), _mm_sub_ps(cy, ay)),
               right = _mm_mul_ps(_mm_sub_ps(by, ay), _mm_sub_ps(cx, ax));
  const __m128 magnitude = _mm_castsi128_ps(_mm_set1_epi32(0x7fffffff));
  const __m128 sum = _mm_add_ps(_mm_and_ps(left, magnitude), _mm_and_ps(right, magnitude));
  const __m128 bound = _mm_add_ps(_mm_mul_ps(sum, _mm_set1_ps(8.0f * 0x1p-24f)), _mm_set1_ps(0x1p-120f));
  return _mm_cmpgt_ps(_mm_and_ps(_mm_sub_ps(left, right), magnitude), bound);
}

/// Lanes [lane, lane + 4) of a block, of which `ids` are triangles; `see` gets their corners.
template <class Block, class See>
void fill_four(Block& block, int lane, const TriangleMesh& mesh, const TriangleVertices& vertices,
               std::span<const std::uint32_t> ids, const See& see) noexcept {
  __m128 corner[3][4];
  const auto take = [&](std::size_t i) __attribute__((always_inline)) {
    const Triangle t = mesh.triangles[ids[i]];
    corner[0][i] = vertices[t.a], corner[1][i] = vertices[t.b], corner[2][i] = vertices[t.c];
    see(corner[0][i], corner[1][i], corner[2][i]);
    block.id[lane + int(i)] = ids[i];
  };
  if (ids.size() == 4) {
    take(0), take(1), take(2), take(3);
  } else {
    for (std::size_t i = 0; i < ids.size(); ++i) take(i);
    for (std::size_t i = ids.size(); i < 4; ++i) {
      corner[0][i] = corner[1][i] = corner[2][i] = _mm_set1_ps(std::numeric_limits<float>::quiet_NaN());
      block.id[lane + int(i)] = kNoPrimitive;
    }
  }
  Points4 a(corner[0][0], corner[0][1], corner[0][2], corner[0][3]),
      b(corner[1][0], corner[1][1], corner[1][2], corner[1][3]),
      c(corner[2][0], corner[2][1], corner[2][2], corner[2][3]);
  // Nearly all triangles are clear in the first projection, walls along an axis in one of the others.
  const int all = (1 << ids.size()) - 1;
  int clear = _mm_movemask_ps(clearly_not_collinear(a.x, a.y, b.x, b.y, c.x, c.y));
  if ((clear & all) != all) clear |= _mm_movemask_ps(clearly_not_collinear(a.y, a.z, b.y, b.z, c.y, c.z));
  if ((clear & all) != all) clear |= _mm_movemask_ps(clearly_not_collinear(a.z, a.x, b.z, b.x, c.z, c.x));
  if ((clear & all) != all) [[unlikely]] {
    alignas(16) std::uint32_t flat[4] = {};
    for (std::size_t i = 0; i < ids.size(); ++i) {
      const std::array<Vec3f, 3> corners = mesh.corners(ids[i]);
      if ((clear >> i & 1) == 0 && has_zero_area(corners[0], corners[1], corners[2])) flat[i] = ~0u;
    }
    const __m128 nan = _mm_load_ps(reinterpret_cast<const float*>(flat));  // all bits set are a NaN
    for (Points4* p : {&a, &b, &c})
      p->x = _mm_or_ps(p->x, nan), p->y = _mm_or_ps(p->y, nan), p->z = _mm_or_ps(p->z, nan);
  }
  const auto store = [lane](float(&rows)[3][Block::kWidth], __m128 x, __m128 y, __m128 z) {
    _mm_storeu_ps(rows[0] + lane, x), _mm_storeu_ps(rows[1] + lane, y), _mm_storeu_ps(rows[2] + lane, z);
  };
  store(block.v0, a.x, a.y, a.z);
  if constexpr (Block::kForm == TriangleForm::edges) {
    store(block.e1, _mm_sub_ps(a.x, b.x), _mm_sub_ps(a.y, b.y), _mm_sub_ps(a.z, b.z));
    store(block.e2, _mm_sub_ps(c.x, a.x), _mm_sub_ps(c.y, a.y), _mm_sub_ps(c.z, a.z));
  } else {
    store(block.v1, b.x, b.y, b.z), store(block.v2, c.x, c.y, c.z);
  }
}

/// fill_blocks(), by fours where the block allows it. `see` gets the corners of each triangle; where the block does
/// not, from a look at them of its own.
template <class Block, class See>
void fill_leaf(Block* block, const TriangleMesh& mesh, std::span<const std::uint32_t> ids, const See& see) noexcept {
  const TriangleVertices vertices(mesh);
  if constexpr (kFillsByFours<Block>) {
    for (; !ids.empty(); ++block) {
      Block& here = *new (block) Block;
      for (int lane = 0; lane < Block::kWidth; lane += 4) {
        const std::size_t count = ids.size() < 4 ? ids.size() : 4;
        fill_four(here, lane, mesh, vertices, ids.first(count), see);
        ids = ids.subspan(count);
      }
    }
  } else {
    fill_blocks(block, mesh, ids);
    clear_padding(block, (ids.size() + std::size_t(Block::kWidth) - 1) / std::size_t(Block::kWidth));
    for (const std::uint32_t id : ids) {
      const Triangle t = mesh.triangles[id];
      see(vertices[t.a], vertices[t.b], vertices[t.c]);
    }
  }
}

}  // namespace arboretum
