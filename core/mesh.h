// TriangleMesh: shared vertices and index triples, key frames where it moves. What structures build from and the oracle
// reads.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/bounds.h"
#include "core/motion.h"

namespace arboretum {

/// Largest |coordinate| that a mesh may hold: products of three float32 terms, differences included, stay finite and
/// normal within 2^-40 .. 2^40 (degree-3 predicates). Loaders drop and count what lies beyond.
inline constexpr float kMaxCoordinate = 1099511627776.0f;  // 2^40

struct Triangle {
  std::uint32_t a = 0, b = 0, c = 0;
  friend bool operator==(const Triangle&, const Triangle&) = default;
};

struct Instancing;  // core/instances.h

struct TriangleMesh {
  std::vector<Vec3f> vertices;  ///< of the first key frame, where it moves
  std::vector<Triangle> triangles;
  std::vector<std::uint16_t> materials;  ///< one a triangle, or empty
  /// The key frames after the first, each with as many vertices; empty: nothing moves. Equally spaced over time [0, 1].
  std::vector<std::vector<Vec3f>> later_frames{};
  std::shared_ptr<const Instancing> instancing{};  ///< what the triangles are instances of; null: of nothing

  [[nodiscard]] std::size_t size() const noexcept { return triangles.size(); }
  [[nodiscard]] bool moves() const noexcept { return !later_frames.empty(); }
  [[nodiscard]] std::size_t frames() const noexcept { return later_frames.size() + 1; }
  [[nodiscard]] const std::vector<Vec3f>& frame(std::size_t k) const noexcept {
    return k == 0 ? vertices : later_frames[k - 1];
  }

  /// A vertex at a time, as frame_at(time, frames()) gives it.
  [[nodiscard]] Vec3f position(std::uint32_t vertex, FrameTime at) const noexcept {
    return moves() ? interpolate(frame(at.frame)[vertex], frame(at.frame + 1)[vertex], at.weight) : vertices[vertex];
  }
  /// Corners in the first key frame.
  [[nodiscard]] std::array<Vec3f, 3> corners(std::size_t i) const noexcept {
    const Triangle& t = triangles[i];
    return {vertices[t.a], vertices[t.b], vertices[t.c]};
  }
  [[nodiscard]] std::array<Vec3f, 3> corners(std::size_t i, FrameTime at) const noexcept {
    const Triangle& t = triangles[i];
    return {position(t.a, at), position(t.b, at), position(t.c, at)};
  }
  /// Bounds of a triangle in all key frames.
  [[nodiscard]] Bounds3f bounds(std::size_t i) const noexcept;
  /// Bounds of all triangles in all key frames (vertices that no triangle uses do not count).
  [[nodiscard]] Bounds3f bounds() const noexcept;
};

/// The mesh as it stands at a time: still, and without instances.
[[nodiscard]] TriangleMesh pose(const TriangleMesh& mesh, float time);

}  // namespace arboretum
