// BatchTracer: batches of a renderer's rays through one row of the kernel table, surfaces with holes passed through.
//
// Kernels know nothing of holes. A ray whose closest hit lets it through is traced again from beyond that hit; one that
// any hit finds occluded, for its closest hits. Where no surface has holes nothing is asked.
#pragma once

#include <span>
#include <vector>

#include "rendering/ray_kinds.h"
#include "rendering/render_scene.h"
#include "rendering/sampler.h"
#include "structures/accel.h"
#include "traversal/kernel_table.h"

namespace arboretum {

/// What a ray belongs to: which random numbers decide whether a hole lets it through.
struct RayOwner {
  Sampler sampler;
  std::uint64_t node = 0;
};

/// Rays that are traced together.
struct TracedRays {
  std::vector<Ray> rays;
  std::vector<float> times;  ///< one a ray, or none: `motion_blur` is off
  std::vector<RayOwner> owners;

  void clear() noexcept { rays.clear(), times.clear(), owners.clear(); }
  [[nodiscard]] std::size_t size() const noexcept { return rays.size(); }
  [[nodiscard]] float time(std::size_t i) const noexcept { return times.empty() ? 0.0f : times[i]; }
};

class BatchTracer {
 public:
  /// All must outlive the tracer; the structure is built from scene.mesh().
  BatchTracer(const RenderScene& scene, const Accel& accel, const KernelRow& kernel, TraversalSettings settings = {})
      : scene_(scene), accel_(accel), kernel_(kernel), settings_(settings) {}

  [[nodiscard]] const RenderScene& scene() const noexcept { return scene_; }
  [[nodiscard]] const Accel& accel() const noexcept { return accel_; }
  [[nodiscard]] const KernelRow& kernel() const noexcept { return kernel_; }

  /// Of rays [begin, begin + hits.size()), which are of one kind.
  void closest_hit(const TracedRays& rays, std::size_t begin, std::span<Hit> hits, RayKind kind,
                   RenderStatistics& statistics) const;
  void any_hit(const TracedRays& rays, std::size_t begin, std::span<std::uint8_t> occluded, RayKind kind,
               RenderStatistics& statistics) const;

 private:
  [[nodiscard]] RayBatch batch_of(const TracedRays& rays, std::size_t begin, std::size_t count, RayKind kind) const;
  void trace(const RayBatch& rays, std::span<Hit> hits, RayKind kind, RenderStatistics& statistics) const;
  void pass_holes(const TracedRays& rays, std::size_t begin, std::span<Hit> hits, PassDimension dimension,
                  RenderStatistics& statistics) const;
  [[nodiscard]] bool lets_through(const Hit& hit, const RayOwner& owner, PassDimension dimension,
                                  std::uint64_t crossing) const;

  const RenderScene& scene_;
  const Accel& accel_;
  const KernelRow& kernel_;
  TraversalSettings settings_;
};

}  // namespace arboretum
