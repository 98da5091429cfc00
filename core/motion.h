// Key frames: which two of them a time lies between, and where a vertex is in between. Everything that looks at a
// moving mesh (kernels, oracle, workloads) goes through these, so that shared vertices stay shared, bit for bit.
#pragma once

#include <cstddef>
#include <cstdint>

#include "core/vec3.h"

namespace arboretum {

/// A time among key frames: a share `weight` of frame `frame` + 1, the rest of `frame`.
struct FrameTime {
  std::uint32_t frame = 0;
  float weight = 0.0f;
};

/// A time outside [0, 1] is the nearer end, NaN is 0.
[[nodiscard]] inline float within_frames(float time) noexcept {
  return time > 0.0f ? (time < 1.0f ? time : 1.0f) : 0.0f;
}

/// `frames` key frames stand equally spaced over [0, 1]; other times are taken as within_frames() says.
/// position - frame is exact, so the weight is off by the rounding of time * (frames - 1) alone.
[[nodiscard]] inline FrameTime frame_at(float time, std::size_t frames) noexcept {
  if (frames < 2) return {};
  const float position = within_frames(time) * float(frames - 1);
  const auto last = std::uint32_t(frames - 2);
  const std::uint32_t frame = std::uint32_t(position) < last ? std::uint32_t(position) : last;
  return {frame, position - float(frame)};
}

/// a (1 - weight) + b weight, each operation rounded to float (no fused multiply-add, on any instruction set): `a` for
/// weight 0, `b` for weight 1.
[[nodiscard]] inline float interpolate(float a, float b, float weight) noexcept {
  return a * (1.0f - weight) + b * weight;
}
[[nodiscard]] inline Vec3f interpolate(Vec3f a, Vec3f b, float weight) noexcept {
  return {interpolate(a.x, b.x, weight), interpolate(a.y, b.y, weight), interpolate(a.z, b.z, weight)};
}

}  // namespace arboretum
