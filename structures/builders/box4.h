// Box4: a box in two registers of four lanes, and triangles fetched ahead of their use. For builders that are written
// once for all instruction sets: SSE2 is in every x86-64.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include <emmintrin.h>

#include "core/mesh.h"

namespace arboretum {

/// Lanes x y z; the fourth holds anything.
struct Box4 {
  __m128 lower = _mm_set1_ps(Bounds3f::kInfinity);
  __m128 upper = _mm_set1_ps(-Bounds3f::kInfinity);

  void extend(__m128 point) noexcept { lower = _mm_min_ps(point, lower), upper = _mm_max_ps(point, upper); }
  void extend(const Box4& box) noexcept { lower = _mm_min_ps(box.lower, lower), upper = _mm_max_ps(box.upper, upper); }
};

[[nodiscard]] inline Vec3f to_vec3f(__m128 v) noexcept {
  alignas(16) float lanes[4];
  _mm_store_ps(lanes, v);
  return {lanes[0], lanes[1], lanes[2]};
}

/// Three coordinates of four points.
struct Points4 {
  __m128 x, y, z;
  Points4(__m128 a, __m128 b, __m128 c, __m128 d) noexcept {
    const __m128 ab = _mm_unpacklo_ps(a, b), cd = _mm_unpacklo_ps(c, d);
    x = _mm_movelh_ps(ab, cd), y = _mm_movehl_ps(cd, ab);
    z = _mm_movelh_ps(_mm_unpackhi_ps(a, b), _mm_unpackhi_ps(c, d));
  }
};

/// A mesh's vertices in lanes x y z; the fourth holds anything.
class TriangleVertices {
 public:
  explicit TriangleVertices(const TriangleMesh& mesh) noexcept
      : vertices_(mesh.vertices.data()), last_(std::uint32_t(mesh.vertices.size() - 1)) {}
  /// The array's last vertex is not read beyond.
  [[nodiscard]] __m128 operator[](std::uint32_t v) const noexcept {
    if (v != last_) [[likely]]
      return _mm_loadu_ps(&vertices_[v].x);
    return _mm_setr_ps(vertices_[v].x, vertices_[v].y, vertices_[v].z, 0.0f);
  }

 private:
  const Vec3f* vertices_;
  std::uint32_t last_;
};

/// A mesh's triangles as boxes.
class TriangleBoxes {
 public:
  explicit TriangleBoxes(const TriangleMesh& mesh) noexcept
      : triangles_(mesh.triangles.data()), vertices_(mesh.vertices.data()), corner_(mesh), far_(mesh.size() > kNear) {}

  /// Whether the mesh is larger than the caches.
  [[nodiscard]] bool are_far() const noexcept { return far_; }
  [[nodiscard]] Box4 box(std::size_t i) const noexcept {
    const Triangle t = triangles_[i];
    const __m128 a = corner_[t.a], b = corner_[t.b], c = corner_[t.c];
    return {_mm_min_ps(_mm_min_ps(a, b), c), _mm_max_ps(_mm_max_ps(a, b), c)};
  }
  /// Asks for what boxes of the triangles ids[begin, end) take, of `last` + 1 ids in the order of their use: vertices
  /// some triangles ahead, triangles twice as many. Not for a small mesh, which the caches hold.
  ///
  /// Inlined by force: a function that only prefetches counts as one without effect, and GCC 12 leaves calls of it out.
  template <class Ids>
  __attribute__((always_inline)) void prefetch(const Ids& id, std::size_t begin, std::size_t end,
                                               std::size_t last) const noexcept {
    if (!far_) return;
    for (std::size_t i = begin; i < end; ++i) {
      ask(triangles_ + id(std::min(i + 2 * kAhead, last)));
      const Triangle t = triangles_[id(std::min(i + kAhead, last))];
      ask(vertices_ + t.a), ask(vertices_ + t.b), ask(vertices_ + t.c);
    }
  }

 private:
  static constexpr std::size_t kNear = std::size_t{1} << 17;  ///< triangles; some 2 MB
  static constexpr std::size_t kAhead = 24;
  __attribute__((always_inline)) static void ask(const void* p) noexcept {
    _mm_prefetch(static_cast<const char*>(p), _MM_HINT_T0);
  }
  const Triangle* triangles_;
  const Vec3f* vertices_;
  TriangleVertices corner_;
  bool far_;
};

}  // namespace arboretum
