// Exact test whether a triangle touches an axis-aligned box, for structures that put a triangle into every
// cell that it touches: the separating axes of Akenine-Moeller (JGT 6(1) 2001), arranged as plane and
// projected edges (Schwarz and Seidel, SIGGRAPH Asia 2010), so that a box costs ten short sums once the
// triangle is prepared.
//
// Arithmetic is double on float32 inputs. A caller inflates its boxes by a pad well above 2^-45 of the
// largest coordinate; then no triangle that touches the box itself is lost to rounding, degenerate triangles
// included.
#pragma once

#include <array>
#include <cmath>

#include "core/mesh.h"

namespace arboretum {

class TriangleOverlap {
 public:
  explicit TriangleOverlap(const std::array<Vec3f, 3>& corner) noexcept {
    double v[3][3];
    for (int i = 0; i < 3; ++i)
      for (int axis = 0; axis < 3; ++axis) v[i][axis] = corner[std::size_t(i)][std::size_t(axis)];
    double edge[3][3];
    for (int i = 0; i < 3; ++i)
      for (int axis = 0; axis < 3; ++axis) edge[i][axis] = v[(i + 1) % 3][axis] - v[i][axis];
    for (int k = 0; k < 3; ++k) {
      const int p = (k + 1) % 3, q = (k + 2) % 3;
      normal_[k] = edge[0][p] * edge[1][q] - edge[0][q] * edge[1][p];
    }
    plane_ = normal_[0] * v[0][0] + normal_[1] * v[0][1] + normal_[2] * v[0][2];
    for (int k = 0; k < 3; ++k) {
      const int p = (k + 1) % 3, q = (k + 2) % 3;
      const double sign = normal_[k] < 0 ? -1.0 : 1.0;
      for (int i = 0; i < 3; ++i) {
        edge_p_[k][i] = -sign * edge[i][q], edge_q_[k][i] = sign * edge[i][p];
        offset_[k][i] = edge_p_[k][i] * v[i][p] + edge_q_[k][i] * v[i][q];
      }
    }
  }

  /// Whether the triangle touches the box; its bounds must touch it (that is not looked at again).
  [[nodiscard]] bool touches(const std::array<double, 3>& center,
                             const std::array<double, 3>& half) const noexcept {
    const double distance = normal_[0] * center[0] + normal_[1] * center[1] + normal_[2] * center[2] - plane_;
    const double reach =
        std::abs(normal_[0]) * half[0] + std::abs(normal_[1]) * half[1] + std::abs(normal_[2]) * half[2];
    if (std::abs(distance) > reach) return false;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t p = (k + 1) % 3, q = (k + 2) % 3;
      for (std::size_t i = 0; i < 3; ++i) {
        const double a = edge_p_[k][i], b = edge_q_[k][i];
        if (a * center[p] + b * center[q] + std::abs(a) * half[p] + std::abs(b) * half[q] < offset_[k][i])
          return false;
      }
    }
    return true;
  }

 private:
  double normal_[3], plane_;
  double edge_p_[3][3], edge_q_[3][3],
      offset_[3][3];  ///< inward normals of the edges, projected along axis k
};

}  // namespace arboretum
