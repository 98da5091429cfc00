// RayKind: what a renderer's ray is for, by the effect that needs it; and how many of each there were, and what they
// took.
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace arboretum {

enum class RayKind : unsigned char {
  camera,
  mirror,
  glossy,
  dielectric,
  diffuse_gi,
  shadow_hard,
  shadow_soft,
  env_light,
  ambient_occlusion,
  alpha_cutout  ///< a ray of another kind, traced again beyond a surface that let it through
};
inline constexpr std::array<std::string_view, 10> kRayKindNames{
    "camera",      "mirror",      "glossy",    "dielectric",        "diffuse_gi",
    "shadow_hard", "shadow_soft", "env_light", "ambient_occlusion", "alpha_cutout"};

struct RenderStatistics {
  struct Rays {
    std::uint64_t rays = 0;
    double seconds = 0.0;  ///< CPU time of tracing them, shading not included
  };
  std::array<Rays, kRayKindNames.size()> of{};
  double seconds = 0.0;          ///< CPU time of all threads, tracing and shading
  std::uint64_t not_finite = 0;  ///< samples with a NaN or an infinity, left out of their pixel

  [[nodiscard]] Rays& operator[](RayKind kind) noexcept { return of[std::size_t(kind)]; }
  [[nodiscard]] const Rays& operator[](RayKind kind) const noexcept { return of[std::size_t(kind)]; }
  [[nodiscard]] Rays total() const noexcept {
    Rays sum;
    for (const Rays& r : of) sum.rays += r.rays, sum.seconds += r.seconds;
    return sum;
  }
  RenderStatistics& operator+=(const RenderStatistics& other) noexcept {
    for (std::size_t i = 0; i < of.size(); ++i) of[i].rays += other.of[i].rays, of[i].seconds += other.of[i].seconds;
    seconds += other.seconds, not_finite += other.not_finite;
    return *this;
  }
};

}  // namespace arboretum
