#include "core/mesh.h"

namespace arboretum {

Bounds3f TriangleMesh::bounds(std::size_t i) const noexcept {
  Bounds3f b;
  for (const Vec3f& p : corners(i)) b.extend(p);
  const Triangle& t = triangles[i];
  for (const std::vector<Vec3f>& f : later_frames) b.extend(f[t.a]), b.extend(f[t.b]), b.extend(f[t.c]);
  return b;
}

Bounds3f TriangleMesh::bounds() const noexcept {
  Bounds3f b;
  for (const Triangle& t : triangles) b.extend(vertices[t.a]), b.extend(vertices[t.b]), b.extend(vertices[t.c]);
  for (const std::vector<Vec3f>& f : later_frames) {
    for (const Triangle& t : triangles) b.extend(f[t.a]), b.extend(f[t.b]), b.extend(f[t.c]);
  }
  return b;
}

TriangleMesh pose(const TriangleMesh& mesh, float time) {
  TriangleMesh posed{mesh.vertices, mesh.triangles, mesh.materials};
  const FrameTime at = frame_at(time, mesh.frames());
  for (std::size_t i = 0; i < posed.vertices.size(); ++i) posed.vertices[i] = mesh.position(std::uint32_t(i), at);
  return posed;
}

}  // namespace arboretum
