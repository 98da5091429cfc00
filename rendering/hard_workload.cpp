#include "rendering/hard_workload.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/random.h"
#include "oracle/hard_rays.h"
#include "scenes/camera.h"

namespace arboretum {
namespace {

constexpr std::string_view kMixture = "hard", kCameraEdges = "camera_edges", kPrefix = "hard_";
/// The kinds that a workload is made of, as far as the mesh has them. The mixture is without `far`: from 2^27 radii
/// away every box is within rounding of the ray, and each such ray visits the whole structure.
std::vector<HardKind> kinds_of(std::string_view name, const HardRayMaker& maker) {
  std::vector<HardKind> kinds;
  for (std::size_t k = 0; k < kMadeKinds; ++k) {
    const auto kind = static_cast<HardKind>(k);
    if (kind == HardKind::invalid || !maker.has(kind)) continue;
    if (name == kMixture ? kind != HardKind::far : name.substr(kPrefix.size()) == to_string(kind))
      kinds.push_back(kind);
  }
  return kinds;
}

Workload camera_edges(const Scene& scene, const View& view) {
  Workload workload{.name = std::string(kCameraEdges), .query = Query::closest_hit, .rays = {}};
  const RayGenerator camera(view_of(scene), view.width, view.height);
  const Vec3f eye = camera.origin();
  const std::size_t count = std::size_t{view.width} * view.height;
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto bits = [&](std::uint64_t dimension) { return random_bits(view.seed, i, dimension); };
    const float time = scene.mesh.moves() ? scene.shutter.open + (scene.shutter.close - scene.shutter.open) *
                                                                     random_float(view.seed, i, 3)
                                          : 0.0f;
    const auto corners = scene.mesh.corners(bits(0) % scene.mesh.size(), frame_at(time, scene.mesh.frames()));
    const std::size_t k = bits(1) % 3;
    const double s = i % 4 == 0 ? 0.0 : random_double(view.seed, i, 2);
    const Vec3f target = to_float(Vec3d(corners[k]) * (1.0 - s) + Vec3d(corners[(k + 1) % 3]) * s);
    if (target == eye) continue;
    workload.rays.push_back({.origin = eye, .direction = target - eye});
    workload.pixels.push_back(camera.pixel(Vec3d(target)));
    if (scene.mesh.moves()) workload.times.push_back(time);
  }
  return workload;
}

}  // namespace

std::span<const std::string_view> hard_workload_names() {
  static const std::vector<std::string> of_kinds = [] {
    std::vector<std::string> names;
    for (std::size_t k = 0; k < kMadeKinds; ++k)
      if (static_cast<HardKind>(k) != HardKind::invalid) names.emplace_back(kPrefix).append(kHardKindNames[k]);
    return names;
  }();
  static const std::vector<std::string_view> names = [] {
    std::vector<std::string_view> all{kMixture};
    all.insert(all.end(), of_kinds.begin(), of_kinds.end());
    all.push_back(kCameraEdges);
    return all;
  }();
  return names;
}

bool is_hard(std::string_view workload) {
  const auto names = hard_workload_names();
  return std::ranges::find(names, workload) != names.end();
}

Workload make_hard_workload(std::string_view name, const Scene& scene, const View& view) {
  if (!is_hard(name)) throw std::invalid_argument("make_hard_workload: no hard workload is called so");
  if (name == kCameraEdges) return camera_edges(scene, view);
  Workload workload{.name = std::string(name), .query = Query::closest_hit, .rays = {}};
  const HardRayMaker maker(scene.mesh);
  const std::vector<HardKind> kinds = kinds_of(name, maker);
  if (kinds.empty()) return workload;
  HardRays made = maker.make(view.seed, 0, std::size_t{view.width} * view.height, kinds);
  workload.rays = std::move(made.rays), workload.times = std::move(made.times);
  return workload;
}

}  // namespace arboretum
