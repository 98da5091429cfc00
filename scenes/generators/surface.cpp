#include "scenes/generators/surface.h"

namespace arboretum {

void MeshBuilder::stitch(Row lower, Row upper, bool ring, std::uint16_t material) {
  const auto vertex = [ring](const Row& row, std::size_t i) {
    return row.first + std::uint32_t(ring && i == row.segments ? 0 : i);
  };
  std::size_t i = 0, j = 0;
  while (i < lower.segments || j < upper.segments) {
    // The row whose next vertex comes first goes on.
    const bool along_lower =
        j == upper.segments || (i < lower.segments && (i + 1) * upper.segments <= (j + 1) * lower.segments);
    if (along_lower) {
      add_triangle(vertex(lower, i), vertex(lower, i + 1), vertex(upper, j), material);
      ++i;
    } else {
      add_triangle(vertex(lower, i), vertex(upper, j + 1), vertex(upper, j), material);
      ++j;
    }
  }
}

std::vector<std::size_t> MeshBuilder::ring_sizes(std::size_t count, double aspect) {
  // k rings of r_1 .. r_k vertices have 2 (r_1 + ... + r_k) triangles, the two fans included.
  const std::size_t vertices = count / 2;
  const std::size_t most = vertices / 3;
  const std::size_t wanted = std::clamp<std::size_t>(std::size_t(std::sqrt(double(vertices) * aspect) + 0.5), 1, most);
  std::size_t rings = wanted;
  for (std::size_t off = 0; off <= wanted / 8; ++off) {  // equal rings where a number of rings nearby allows it
    if (vertices % (wanted - off) == 0) {
      rings = wanted - off;
      break;
    }
    if (wanted + off <= most && vertices % (wanted + off) == 0) {
      rings = wanted + off;
      break;
    }
  }
  std::vector<std::size_t> sizes(rings, vertices / rings);
  const std::size_t rest = vertices % rings, first = (rings - rest) / 2;
  for (std::size_t i = 0; i < rest; ++i) ++sizes[first + i];
  return sizes;
}

void MeshBuilder::add_box(Vec3d lower, Vec3d upper, std::uint16_t material) {
  const auto first = std::uint32_t(mesh_.vertices.size());
  for (int i = 0; i < 8; ++i)
    add_vertex({i & 1 ? upper.x : lower.x, i & 2 ? upper.y : lower.y, i & 4 ? upper.z : lower.z});
  constexpr std::uint32_t kQuads[6][4] = {{0, 4, 6, 2}, {1, 3, 7, 5}, {0, 1, 5, 4},
                                          {2, 6, 7, 3}, {0, 2, 3, 1}, {4, 5, 7, 6}};
  for (const auto& q : kQuads) {
    add_triangle(first + q[0], first + q[1], first + q[2], material);
    add_triangle(first + q[0], first + q[2], first + q[3], material);
  }
}

}  // namespace arboretum
