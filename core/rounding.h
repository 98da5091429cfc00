// Directed rounding of doubles to float32, and the float32 numbers next to one. Inline, where std::nextafter is a call.
#pragma once

#include <bit>
#include <cstdint>

namespace arboretum {

/// The largest float below x, and of zero the smallest negative one; x is neither NaN nor -infinity.
[[nodiscard]] inline float next_below(float x) noexcept {
  if (x == 0.0f) return -std::bit_cast<float>(1u);
  const auto bits = std::bit_cast<std::uint32_t>(x);
  return std::bit_cast<float>(x > 0.0f ? bits - 1 : bits + 1);
}
/// The smallest float above x, and of zero the smallest positive one; x is neither NaN nor infinity.
[[nodiscard]] inline float next_above(float x) noexcept { return -next_below(-x); }

/// The largest float that is not above x; NaN stays NaN.
[[nodiscard]] inline float rounded_down(double x) noexcept {
  const auto f = static_cast<float>(x);
  return static_cast<double>(f) > x ? next_below(f) : f;
}
/// The smallest float that is not below x; NaN stays NaN.
[[nodiscard]] inline float rounded_up(double x) noexcept { return -rounded_down(-x); }

}  // namespace arboretum
