// Exact test whether a triangle touches an axis-aligned box, for structures that put a triangle into every
// cell that it touches: the separating axes of Akenine-Moeller (JGT 6(1) 2001), arranged as plane and
// projected edges (Schwarz and Seidel, SIGGRAPH Asia 2010), so that a box costs ten short sums once the
// triangle is prepared.
//
// Arithmetic is double on float32 inputs. A caller inflates its boxes by a pad well above 2^-45 of the
// largest coordinate; then no triangle that touches the box itself is lost to rounding, degenerate triangles
// and needles included, whose normals may be all rounding: an edge leaves all three corners inside, and the plane is
// as thick as the normal is uncertain.
#pragma once

#include <algorithm>
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
    // A component of the normal is off by hardly more than 2^-51 of the sum of its two products' sizes (edges, products
    // and difference round), so by less than `error`. A point x that triangle and box share is at most twice the
    // largest coordinate from the corner that the plane goes through: of the box's center, n.(c - v0) is then at most
    // what the box reaches, |n|.half, and the errors times those distances, the plane's thickness.
    for (int k = 0; k < 3; ++k) {
      const int p = (k + 1) % 3, q = (k + 2) % 3;
      const double ahead = edge[0][p] * edge[1][q], back = edge[0][q] * edge[1][p],
                   error = 0x1p-50 * (std::abs(ahead) + std::abs(back));
      normal_[k] = ahead - back;
      size_[k] = std::abs(normal_[k]) + error;
      thickness_ += 2.0 * error * std::max({std::abs(v[0][k]), std::abs(v[1][k]), std::abs(v[2][k])});
    }
    plane_ = normal_[0] * v[0][0] + normal_[1] * v[0][1] + normal_[2] * v[0][2];
    for (int k = 0; k < 3; ++k) {
      const int p = (k + 1) % 3, q = (k + 2) % 3;
      const double sign = normal_[k] < 0 ? -1.0 : 1.0;
      for (int i = 0; i < 3; ++i) {
        edge_p_[k][i] = -sign * edge[i][q], edge_q_[k][i] = sign * edge[i][p];
        const auto at = [&](int corner) { return edge_p_[k][i] * v[corner][p] + edge_q_[k][i] * v[corner][q]; };
        offset_[k][i] = std::min({at(0), at(1), at(2)});
      }
    }
  }

  /// Whether the triangle touches the box; its bounds must touch it (that is not looked at again).
  [[nodiscard]] bool touches(const std::array<double, 3>& center, const std::array<double, 3>& half) const noexcept {
    const double distance = normal_[0] * center[0] + normal_[1] * center[1] + normal_[2] * center[2] - plane_;
    const double reach = size_[0] * half[0] + size_[1] * half[1] + size_[2] * half[2] + thickness_;
    if (std::abs(distance) > reach) return false;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t p = (k + 1) % 3, q = (k + 2) % 3;
      for (std::size_t i = 0; i < 3; ++i) {
        const double a = edge_p_[k][i], b = edge_q_[k][i];
        if (a * center[p] + b * center[q] + std::abs(a) * half[p] + std::abs(b) * half[q] < offset_[k][i]) return false;
      }
    }
    return true;
  }

 private:
  double normal_[3], plane_;
  double size_[3], thickness_ = 0.0;  ///< |normal| at most; how far the plane may be off, times |normal|
  /// inward normals of the edges, projected along axis k
  double edge_p_[3][3], edge_q_[3][3], offset_[3][3];
};

}  // namespace arboretum
