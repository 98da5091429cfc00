// Workloads: the rays of the `workload` axis (docs/command-line.md), made once for a scene, view and seed, and shared
// by all cells.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/ray.h"
#include "rendering/self_intersection.h"
#include "scenes/scene.h"
#include "scenes/vec3d.h"

namespace arboretum {

/// How far rays of ambient occlusion look, as a share of the diagonal of the scene's bounds.
inline constexpr double kOcclusionReach = 0.2;

enum class Query { closest_hit, any_hit };

struct Workload {
  std::string name;
  Query query = Query::closest_hit;
  std::vector<Ray> rays;  ///< in tile (Morton) order of the pixels they belong to
  /// Within the scene's shutter, one a ray, where the scene moves; else empty. Secondary rays keep their primary ray's.
  std::vector<float> times{};
  std::vector<std::array<float, 2>> pixels{};  ///< of `camera_edges`: where in the picture each ray is aimed at
  // Of secondary rays, one a ray; else empty.
  std::vector<std::uint32_t> sources{};         ///< the primitive that the ray starts on
  std::vector<std::array<double, 3>> starts{};  ///< the hit point itself, in doubles on the grid of float32
  std::vector<Ray> references{};                ///< the ray as it leaves the hit point itself, its origin rounded
  bool excludes_sources = false;                ///< rays pass through their source: SelfIntersection::exclusion
  /// `primary` rays are marked coherent. Those towards a light are not: on most scenes that costs Embree more than it
  /// gives (docs/performance/embree.md).
  [[nodiscard]] RayBatch batch() const noexcept;
};

struct View {
  unsigned width = 512, height = 512;
  std::uint64_t seed = 1;
  SurfaceStart start{};  ///< how secondary rays leave their surface
};

/// The names that make_workload takes, in the order of docs/command-line.md.
[[nodiscard]] std::span<const std::string_view> workload_names();
/// Whether the workload starts at the primary rays' hits. Throws UserError for a name that make_workload does not take.
[[nodiscard]] bool is_secondary(std::string_view workload);
/// The same for any name.
[[nodiscard]] bool starts_on_surfaces(std::string_view workload) noexcept;
[[nodiscard]] Query query_of(std::string_view workload);

/// One primary ray a pixel, Morton order. A scene without a camera is framed whole from a fixed three-quarter view.
[[nodiscard]] Workload make_primary(const Scene& scene, const View& view);
/// Where `shadow` rays go to: the scene's first point light, else a point above the camera by a quarter of the median
/// distance to what it sees.
[[nodiscard]] Vec3d light_position(const Scene& scene, RayBatch primary_rays, std::span<const Hit> primary_hits);
/// Any workload. `primary_hits` are the reference hits (the oracle's) of make_primary's rays; secondary workloads have
/// one ray for each of them that hit, starting as view.start says (by default offset so that it does not meet its own
/// surface): for every way as many, in the same order, in the same directions. `primary` and `random` ignore them.
[[nodiscard]] Workload make_workload(std::string_view name, const Scene& scene, const View& view, RayBatch primary_rays,
                                     std::span<const Hit> primary_hits);

}  // namespace arboretum
