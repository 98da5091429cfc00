// Hard workloads: rays aimed at what tests and boxes get wrong (oracle/hard_rays.h), as many as the picture has pixels,
// measured and checked as other workloads are.
#pragma once

#include <span>
#include <string_view>

#include "rendering/workload.h"

namespace arboretum {

/// `hard`, a mixture of all kinds but `far`, and `hard_KIND` for each of them that is a ray at all; `camera_edges`.
[[nodiscard]] std::span<const std::string_view> hard_workload_names();
[[nodiscard]] bool is_hard(std::string_view workload);

/// Closest hit. `camera_edges`: from the camera at points of edges and, every fourth, at vertices, with
/// Workload::pixels. No ray at all where the mesh lacks what they are aimed at (`hard_border` of a closed one).
[[nodiscard]] Workload make_hard_workload(std::string_view name, const Scene& scene, const View& view);

}  // namespace arboretum
