#include "rendering/camera_rays.h"

#include <cmath>

#include "rendering/pixels.h"

namespace arboretum {

void CameraRays::add(std::span<const PixelSample> samples, TracedRays& rays) const {
  const bool lens = scene_.effects().has(EffectKind::dof), moving = scene_.effects().has(EffectKind::motion_blur);
  const double open = scene_.shutter().open, close = scene_.shutter().close;
  for (const PixelSample& s : samples) {
    const Sampler sampler(settings_.seed, s.y * settings_.width + s.x, s.sample);
    const double x = s.x + sampler.camera(CameraDimension::picture_x),
                 y = s.y + sampler.camera(CameraDimension::picture_y);
    if (lens) {
      const double r = std::sqrt(sampler.camera(CameraDimension::lens_x));
      const UnitCircle circle(sampler.camera(CameraDimension::lens_y));
      rays.rays.push_back(generator_.ray(x, y, r * circle.cosine, r * circle.sine));
    } else {
      rays.rays.push_back(generator_.ray(x, y));
    }
    if (moving) rays.times.push_back(float(open + (close - open) * sampler.camera(CameraDimension::time)));
    rays.owners.push_back({sampler, Sampler::kCamera});
  }
}

std::vector<PixelSample> CameraRays::samples(std::uint32_t x, std::uint32_t y, std::uint32_t size, std::uint32_t first,
                                             std::uint32_t last) const {
  std::vector<PixelSample> all;
  for (std::uint32_t sample = first; sample < last; ++sample)
    visit_morton(x, y, size, settings_.width, settings_.height, [&](unsigned px, unsigned py) {
      all.push_back({px, py, sample});
    });
  return all;
}

}  // namespace arboretum
