#include "rendering/camera_rays.h"

#include <cmath>

namespace arboretum {

void CameraRays::add(std::span<const PixelSample> samples, TracedRays& rays) const {
  const bool lens = scene_.effects().has(EffectKind::dof), moving = scene_.effects().has(EffectKind::motion_blur);
  const double open = scene_.shutter().open, close = scene_.shutter().close;
  for (const PixelSample& s : samples) {
    const Sampler sampler(settings_.seed, s.y * settings_.width + s.x, s.sample);
    const double x = s.x + sampler.camera(CameraDimension::picture_x), y = s.y + sampler.camera(CameraDimension::picture_y);
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
  const auto every_other_bit = [](std::uint32_t code) {
    std::uint32_t bits = 0;
    for (std::uint32_t i = 0; i < 16; ++i) bits |= (code >> (2 * i) & 1u) << i;
    return bits;
  };
  std::vector<PixelSample> all;
  for (std::uint32_t sample = first; sample < last; ++sample) {
    for (std::uint32_t code = 0; code < size * size; ++code) {
      const std::uint32_t px = x + every_other_bit(code), py = y + every_other_bit(code >> 1);
      if (px < settings_.width && py < settings_.height) all.push_back({px, py, sample});
    }
  }
  return all;
}

}  // namespace arboretum
