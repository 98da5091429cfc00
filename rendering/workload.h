// Workloads: the rays of the contract's `workload` axis, made once for a scene, view and seed, and shared by all cells.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/ray.h"
#include "scenes/scene.h"

namespace arboretum {

enum class Query { closest_hit, any_hit };

struct Workload {
  std::string name;
  Query query = Query::closest_hit;
  std::vector<Ray> rays;  ///< in tile (Morton) order of the pixels they belong to
  /// Within the scene's shutter, one a ray, where the scene moves; else empty. Secondary rays keep their primary ray's.
  std::vector<float> times{};
  /// `primary` and `shadow` rays are marked coherent.
  [[nodiscard]] RayBatch batch() const noexcept;
};

struct View {
  unsigned width = 512, height = 512;
  std::uint64_t seed = 1;
};

/// The names that make_workload takes, in the contract's order.
[[nodiscard]] std::span<const std::string_view> workload_names();
/// Whether the workload starts at the primary rays' hits.
[[nodiscard]] bool is_secondary(std::string_view workload);
[[nodiscard]] Query query_of(std::string_view workload);

/// One primary ray a pixel, Morton order. A scene without a camera is framed whole from a fixed three-quarter view.
[[nodiscard]] Workload make_primary(const Scene& scene, const View& view);
/// Any workload. `primary_hits` are the reference hits (the oracle's) of make_primary's rays; secondary workloads have one
/// ray for each of them that hit, offset so that it does not meet its own surface. `primary` and `random` ignore them.
[[nodiscard]] Workload make_workload(std::string_view name, const Scene& scene, const View& view,
                                     RayBatch primary_rays, std::span<const Hit> primary_hits);

}  // namespace arboretum
