// Camera rays of a renderer: one for each sample of a pixel, anywhere within it, on the lens and while the shutter is
// open.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "rendering/batch_tracer.h"
#include "rendering/render.h"
#include "scenes/camera.h"

namespace arboretum {

/// One sample of one pixel.
struct PixelSample {
  std::uint32_t x = 0, y = 0, sample = 0;
};

class CameraRays {
 public:
  CameraRays(const RenderScene& scene, const RenderSettings& settings)
      : scene_(scene), settings_(settings), generator_(scene.camera(), settings.width, settings.height) {}

  /// Appends a ray for each sample.
  void add(std::span<const PixelSample> samples, TracedRays& rays) const;
  /// The pixels of the square of side `size` (a power of two) at (x, y) that lie in the picture, in Morton order; all
  /// with the samples [first, last), sample by sample.
  [[nodiscard]] std::vector<PixelSample> samples(std::uint32_t x, std::uint32_t y, std::uint32_t size,
                                                 std::uint32_t first, std::uint32_t last) const;

 private:
  const RenderScene& scene_;
  const RenderSettings& settings_;
  RayGenerator generator_;
};

}  // namespace arboretum
