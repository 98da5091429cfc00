// MeshBuilder: surfaces tessellated to an exact number of triangles.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/mesh.h"
#include "scenes/vec3d.h"

namespace arboretum {

class MeshBuilder {
 public:
  std::uint32_t add_vertex(Vec3d p) {
    mesh_.vertices.push_back(to_float(p));
    return std::uint32_t(mesh_.vertices.size() - 1);
  }
  void add_triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::uint16_t material) {
    mesh_.triangles.push_back({a, b, c});
    mesh_.materials.push_back(material);
  }
  /// The image of the unit square under position(u, v), exactly `count` triangles (>= 1; one is half a
  /// square), facing du x dv. `aspect` is the surface's width (along u) over its height. No T-vertices
  /// inside.
  template <class Position>
  void add_patch(std::size_t count, double aspect, std::uint16_t material, const Position& position);
  /// A closed surface, exactly `count` triangles (even, >= 6): rings position(v, turns) with 0 < v < 1
  /// between two poles, position(0, 0) and position(1, 0), each with a fan. Faces outward where increasing
  /// `turns` goes counter-clockwise seen from pole 1 (v = 1). `aspect`: length from pole to pole over the
  /// largest circumference.
  template <class Position>
  void add_closed(std::size_t count, double aspect, std::uint16_t material, const Position& position);
  /// The 12 triangles of a box.
  void add_box(Vec3d lower, Vec3d upper, std::uint16_t material);

  [[nodiscard]] std::size_t size() const noexcept { return mesh_.size(); }
  [[nodiscard]] TriangleMesh take() { return std::move(mesh_); }

  /// The count that add_closed can make nearest below `count`.
  [[nodiscard]] static std::size_t closed_count(std::size_t count) noexcept {
    return std::max<std::size_t>(6, count & ~std::size_t{1});
  }

 private:
  struct Row {
    std::uint32_t first;
    std::size_t segments;
  };
  /// a + b triangles between two rows of a and b segments. On rings the last vertex is the first again.
  void stitch(Row lower, Row upper, bool ring, std::uint16_t material);
  /// Rings of a closed surface: their number and, in the order of v, how many vertices each has.
  [[nodiscard]] static std::vector<std::size_t> ring_sizes(std::size_t count, double aspect);

  TriangleMesh mesh_;
};

template <class Position>
void MeshBuilder::add_patch(std::size_t count, double aspect, std::uint16_t material, const Position& position) {
  if (count == 1) {
    const std::uint32_t a = add_vertex(position(0.0, 0.0)), b = add_vertex(position(1.0, 0.0)),
                        c = add_vertex(position(0.0, 1.0));
    add_triangle(a, b, c, material);
    return;
  }
  const std::size_t rows =
      std::clamp<std::size_t>(std::size_t(std::sqrt(double(count) / (2.0 * aspect)) + 0.5), 1, count / 2);
  const std::size_t columns = count / (2 * rows);
  // What rows of equal length leave over goes into longer lines of vertices: one more segment on an inner
  // line makes two more triangles, on the last line one.
  const std::size_t rest = count - 2 * rows * columns;
  Row below{};
  for (std::size_t i = 0; i <= rows; ++i) {
    std::size_t segments = columns;
    if (i == rows)
      segments += rest & 1;
    else if (i >= 1 && i <= rest / 2)
      segments += 1;
    const Row row{std::uint32_t(mesh_.vertices.size()), segments};
    for (std::size_t j = 0; j <= segments; ++j)
      add_vertex(position(double(j) / double(segments), double(i) / double(rows)));
    if (i > 0) stitch(below, row, false, material);
    below = row;
  }
}

template <class Position>
void MeshBuilder::add_closed(std::size_t count, double aspect, std::uint16_t material, const Position& position) {
  const std::vector<std::size_t> sizes = ring_sizes(count, aspect);
  const std::uint32_t pole = add_vertex(position(0.0, 0.0));
  Row below{};
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const Row row{std::uint32_t(mesh_.vertices.size()), sizes[i]};
    const double v = double(i + 1) / double(sizes.size() + 1);
    for (std::size_t j = 0; j < sizes[i]; ++j) add_vertex(position(v, double(j) / double(sizes[i])));
    if (i == 0) {
      for (std::size_t j = 0; j < row.segments; ++j)
        add_triangle(pole, row.first + std::uint32_t((j + 1) % row.segments), row.first + std::uint32_t(j), material);
    } else {
      stitch(below, row, true, material);
    }
    below = row;
  }
  const std::uint32_t other_pole = add_vertex(position(1.0, 0.0));
  for (std::size_t j = 0; j < below.segments; ++j)
    add_triangle(other_pole, below.first + std::uint32_t(j), below.first + std::uint32_t((j + 1) % below.segments),
                 material);
}

}  // namespace arboretum
