#include "structures/box_pads.h"

#include <algorithm>
#include <limits>
#include <vector>

#include "core/coordinates.h"
#include "core/rounding.h"

namespace arboretum {

float largest_coordinate(const TriangleMesh& mesh, std::span<const std::uint32_t> ids) noexcept {
  float largest = 0.0f;
  for (const std::uint32_t id : ids) largest = std::max(largest, largest_coordinate(mesh.bounds(id)));
  return largest;
}

BoxPads::BoxPads(const TriangleMesh& mesh, const Bounds3f& bounds)
    : largest_(largest_coordinate(bounds)), common_(largest_) {
  if (mesh.size() == 0) return;
  // Any choice keeps the promise, so a sample is enough.
  std::vector<float> samples;
  const std::size_t step = (mesh.size() + kMostSamples - 1) / kMostSamples;
  samples.reserve(mesh.size() / step + 1);
  for (std::size_t i = 0; i < mesh.size(); i += step) samples.push_back(largest_coordinate(mesh.bounds(i)));
  const auto near = samples.begin() + std::ptrdiff_t(samples.size() / kOneIn);
  std::nth_element(samples.begin(), near, samples.end());
  // Where floats end boxes could not be wider.
  if (largest_ < 0.5f * std::numeric_limits<float>::max())
    common_ = std::min(largest_, std::max(kWithin * *near, kLeast * largest_));
}

double BoxPads::pad(float largest) const noexcept {
  const float larger = largest - common_;
  return larger > 0.0f ? kShare * double(larger) * (1.0 + 0x1p-22) : 0.0;
}

Bounds3f BoxPads::widened(const Bounds3f& box) const noexcept {
  const double by = pad(largest_coordinate(box));
  return by > 0.0 ? widened(box, by) : box;
}

Bounds3f BoxPads::widened(const Bounds3f& box, double pad) noexcept {
  Bounds3f wide;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    wide.lower[axis] = rounded_down(double(box.lower[axis]) - pad);
    wide.upper[axis] = rounded_up(double(box.upper[axis]) + pad);
  }
  return wide;
}

}  // namespace arboretum
