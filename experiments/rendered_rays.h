// RenderedRays: the workloads `whitted` and `path`: a renderer's whole picture, one sample a pixel, shading included,
// by any kernel.
//
// What is timed is the renderer as the cell's own answers lead it. What is checked are rays that are recorded once:
// those that the renderer sends out when the exact answers lead it, so that every cell has to answer the same.
#pragma once

#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "oracle/oracle.h"
#include "rendering/render.h"
#include "rendering/workload.h"

namespace arboretum {

[[nodiscard]] std::span<const std::string_view> rendered_workload_names();
[[nodiscard]] bool is_rendered(std::string_view workload) noexcept;

class RenderedRays {
 public:
  /// With the effects that the scene calls for. `light`: where a scene without any gets a point light, as `shadow` has
  /// it.
  RenderedRays(std::string_view workload, const Scene& scene, const View& view, Vec3d light, const Oracle& oracle);

  /// The picture by a kernel whose structure is built from the scene's whole mesh; what it took is added.
  Picture render(const Accel& accel, const KernelRow& kernel, TraversalSettings settings, unsigned threads,
                 RenderStatistics& statistics) const;

  /// Recorded rays of a kind of query, those of a tile together, and their exact answers.
  [[nodiscard]] const Workload& closest() const noexcept { return closest_; }
  [[nodiscard]] const Workload& any() const noexcept { return any_; }
  [[nodiscard]] const std::vector<ExactHit>& closest_truth() const noexcept { return closest_truth_; }
  [[nodiscard]] const std::vector<std::uint8_t>& any_truth() const noexcept { return any_truth_; }
  /// The picture that the exact answers give.
  [[nodiscard]] const Picture& picture() const noexcept { return picture_; }

 private:
  std::unique_ptr<const RenderScene> scene_;
  RenderSettings settings_;
  Workload closest_, any_;
  std::vector<ExactHit> closest_truth_;
  std::vector<std::uint8_t> any_truth_;
  Picture picture_;
};

}  // namespace arboretum
