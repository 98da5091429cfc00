// The sRGB transfer function (IEC 61966-2-1), for one channel within [0, 1].
#pragma once

#include <cmath>

namespace arboretum {

[[nodiscard]] inline float srgb_to_linear(float stored) noexcept {
  return stored <= 0.04045f ? stored / 12.92f : std::pow((stored + 0.055f) / 1.055f, 2.4f);
}
[[nodiscard]] inline float linear_to_srgb(float linear) noexcept {
  return linear <= 0.0031308f ? linear * 12.92f : 1.055f * std::pow(linear, 1.0f / 2.4f) - 0.055f;
}

}  // namespace arboretum
