// Sampler: the random numbers of one sample of one pixel. Each use has a dimension of its own and the value depends on
// seed, pixel, sample and dimension alone, so leaving an effect out shifts no other effect's numbers.
#pragma once

#include <cstdint>

#include "core/random.h"

namespace arboretum {

/// Dimensions of the camera ray.
enum class CameraDimension : std::uint64_t { picture_x, picture_y, time, lens_x, lens_y };
/// Dimensions at each hit of a path.
enum class HitDimension : std::uint64_t {
  lobe,
  direction_u,
  direction_v,
  light,
  light_u,
  light_v,
  roulette,
  environment_lobe,
  environment_u,
  environment_v
};
/// For which ray a surface with holes is asked whether it lets the ray through.
enum class PassDimension : std::uint64_t { path, light, environment };

class Sampler {
 public:
  Sampler(std::uint64_t seed, std::uint32_t pixel, std::uint32_t sample) noexcept
      : seed_(seed), index_(std::uint64_t(sample) << 32 | pixel) {}

  [[nodiscard]] double camera(CameraDimension d) const noexcept {
    return random_double(seed_, index_, std::uint64_t(d));
  }
  /// `node`: which hit of the path; of paths that branch, the children of node n are 2 n + 1 and 2 n + 2.
  [[nodiscard]] double hit(std::uint64_t node, HitDimension d) const noexcept {
    return random_double(seed_, index_, kHits + node * kDimensionsOfHit + std::uint64_t(d));
  }
  /// The `crossing`-th surface with holes that a ray meets which leaves hit `node`, or, with node = kCamera, the
  /// camera.
  [[nodiscard]] double pass(std::uint64_t node, PassDimension ray, std::uint64_t crossing) const noexcept {
    return random_double(seed_ ^ kPasses, index_, (node * 4 + std::uint64_t(ray)) * kMostCrossings + crossing);
  }
  static constexpr std::uint64_t kCamera = (std::uint64_t{1} << 40) - 1;

 private:
  static constexpr std::uint64_t kHits = 16, kDimensionsOfHit = 16, kMostCrossings = 1 << 20,
                                 kPasses = 0x9d8f3c2ab1e64705u;
  std::uint64_t seed_, index_;
};

}  // namespace arboretum
