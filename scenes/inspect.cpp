#include "scenes/inspect.h"

#include <algorithm>
#include <numeric>
#include <set>
#include <tuple>

#include <tbb/parallel_sort.h>

#include "core/instances.h"
#include "scenes/appearance.h"
#include "scenes/images.h"
#include "scenes/vec3d.h"

namespace arboretum {
namespace {

/// For each vertex the lowest-numbered one at the same position (+0 and -0 are the same).
std::vector<std::uint32_t> weld(const std::vector<Vec3f>& vertices) {
  std::vector<std::uint32_t> order(vertices.size());
  std::iota(order.begin(), order.end(), 0u);
  tbb::parallel_sort(order.begin(), order.end(), [&](std::uint32_t i, std::uint32_t j) {
    const Vec3f &a = vertices[i], &b = vertices[j];
    return std::tie(a.x, a.y, a.z, i) < std::tie(b.x, b.y, b.z, j);
  });
  std::vector<std::uint32_t> representative(vertices.size());
  for (std::size_t k = 0; k < order.size(); ++k) {
    const bool same = k > 0 && vertices[order[k]] == vertices[order[k - 1]];
    representative[order[k]] = same ? representative[order[k - 1]] : order[k];
  }
  return representative;
}

bool is_sliver(const std::array<Vec3f, 3>& corners) {
  const Vec3d a(corners[0]), b(corners[1]), c(corners[2]);
  const Vec3d ab = b - a, bc = c - b, ca = a - c;
  return std::max({dot(ab, ab), dot(bc, bc), dot(ca, ca)}) > 100.0 * length(cross(ab, ca));
}

}  // namespace

SceneInfo inspect_scene(const Scene& scene) {
  const TriangleMesh& mesh = scene.mesh;
  SceneInfo info;
  info.triangles = mesh.size();
  info.vertices = mesh.vertices.size();
  info.bounds = mesh.bounds();
  info.report = scene.report;
  info.lights = scene.lights.size();
  for (std::size_t i = 0; i < mesh.size(); ++i) info.slivers += is_sliver(mesh.corners(i));

  const std::vector<std::uint32_t> welded = weld(mesh.vertices);
  std::vector<std::array<std::uint32_t, 3>> triples(mesh.size());
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    triples[i] = {welded[t.a], welded[t.b], welded[t.c]};
    std::sort(triples[i].begin(), triples[i].end());
  }
  tbb::parallel_sort(triples.begin(), triples.end());
  for (std::size_t i = 1; i < triples.size(); ++i) info.duplicates += triples[i] == triples[i - 1];

  std::vector<std::uint64_t> edges;
  edges.reserve(3 * triples.size());
  for (const auto& [a, b, c] : triples)
    for (const auto& [from, to] : {std::pair{a, b}, {b, c}, {a, c}}) edges.push_back(std::uint64_t(from) << 32 | to);
  tbb::parallel_sort(edges.begin(), edges.end());
  for (std::size_t i = 0; i < edges.size();) {
    std::size_t next = i + 1;
    while (next < edges.size() && edges[next] == edges[i]) ++next;
    ++info.edges;
    info.boundary_edges += next - i == 1;
    info.non_manifold_edges += next - i > 2;
    i = next;
  }
  info.closed = info.triangles > 0 && info.boundary_edges == 0 && info.non_manifold_edges == 0;

  std::vector<bool> used(scene.materials.size());
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const std::size_t id = mesh.materials.empty() ? 0 : mesh.materials[i];
    if (id >= used.size()) continue;
    used[id] = true;
    const Vec3f emission = scene.materials[id].emission;
    info.emissive_triangles += emission.x > 0 || emission.y > 0 || emission.z > 0;
  }
  info.materials = std::size_t(std::count(used.begin(), used.end(), true));
  info.key_frames = mesh.frames(), info.shutter = scene.shutter;
  for (std::size_t i = 0; i < mesh.size(); ++i) {
    const Triangle& t = mesh.triangles[i];
    info.moving_triangles += std::ranges::any_of(mesh.later_frames, [&](const std::vector<Vec3f>& frame) {
      return frame[t.a] != mesh.vertices[t.a] || frame[t.b] != mesh.vertices[t.b] || frame[t.c] != mesh.vertices[t.c];
    });
  }
  if (mesh.instancing) {
    info.instances = mesh.instancing->instances.size(), info.prototypes = mesh.instancing->prototypes.size();
    for (const TriangleMesh& prototype : mesh.instancing->prototypes) info.prototype_triangles += prototype.size();
  }
  info.named_instances = scene.instances;
  info.effects = effects_of(scene);
  std::set<std::string> images;
  for (std::size_t i = 0; i < scene.materials.size(); ++i) {
    if (!used[i]) continue;
    const Material& m = scene.materials[i];
    for (const auto& [image, place] :
         {std::pair(m.diffuse_map, m.diffuse_map_place), {m.opacity_map, m.opacity_map_place}})
      if (!image.empty() && images.insert(image).second && !value_range(image))
        info.report.warnings.push_back(unread_image(place, image));
  }
  for (std::string& line : unseen_materials(scene)) info.report.warnings.push_back(std::move(line));
  return info;
}

}  // namespace arboretum
