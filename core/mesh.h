// TriangleMesh: shared vertices and index triples. What structures build from and the oracle reads.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/bounds.h"

namespace arboretum {

/// Largest |coordinate| that a mesh may hold: products of three float32 terms, differences included, stay finite and
/// normal within 2^-40 .. 2^40 (degree-3 predicates). Loaders drop and count what lies beyond.
inline constexpr float kMaxCoordinate = 1099511627776.0f;  // 2^40

struct Triangle {
  std::uint32_t a = 0, b = 0, c = 0;
  friend bool operator==(const Triangle&, const Triangle&) = default;
};

struct TriangleMesh {
  std::vector<Vec3f> vertices;
  std::vector<Triangle> triangles;
  std::vector<std::uint16_t> materials;  ///< one a triangle, or empty

  [[nodiscard]] std::size_t size() const noexcept { return triangles.size(); }
  [[nodiscard]] std::array<Vec3f, 3> corners(std::size_t i) const noexcept {
    const Triangle& t = triangles[i];
    return {vertices[t.a], vertices[t.b], vertices[t.c]};
  }
  [[nodiscard]] Bounds3f bounds(std::size_t i) const noexcept {
    Bounds3f b;
    for (const Vec3f& p : corners(i)) b.extend(p);
    return b;
  }
  /// Bounds of all triangles (vertices that no triangle uses do not count).
  [[nodiscard]] Bounds3f bounds() const noexcept {
    Bounds3f b;
    for (const Triangle& t : triangles) b.extend(vertices[t.a]), b.extend(vertices[t.b]), b.extend(vertices[t.c]);
    return b;
  }
};

}  // namespace arboretum
