// The colours of heat maps: computed, not tabled.
#include <algorithm>
#include <cmath>

#include "rendering/heat_map.h"
#include "rendering/transfer.h"
#include "scenes/vec3d.h"

namespace arboretum {
namespace {

/// CIELAB (D65) to linear sRGB; outside of [0, 1] where the screen cannot show it.
Vec3d linear_of(Vec3d lab) {
  const auto inverse = [](double t) { return t > 6.0 / 29.0 ? t * t * t : 3.0 * 36.0 / 841.0 * (t - 4.0 / 29.0); };
  const double fy = (lab.x + 16.0) / 116.0;
  const double x = 0.95047 * inverse(fy + lab.y / 500.0), y = inverse(fy), z = 1.08883 * inverse(fy - lab.z / 200.0);
  return {3.2406 * x - 1.5372 * y - 0.4986 * z, -0.9689 * x + 1.8758 * y + 0.0415 * z,
          0.0557 * x - 0.2040 * y + 1.0570 * z};
}

bool can_be_shown(Vec3d lab) {
  const Vec3d c = linear_of(lab);
  return std::min({c.x, c.y, c.z}) >= 0.0 && std::max({c.x, c.y, c.z}) <= 1.0;
}

/// From nearly black over violet and red to light yellow: lightness 6 to 96, hue by way of 0 degrees, as much colour as
/// the screen shows at every point but for a tenth, and less of it towards both ends.
Vec3d on_path(double t) {
  const UnitCircle hue((295.0 + 165.0 * t) / 360.0);
  const auto lab = [&](double chroma) { return Vec3d{6.0 + 90.0 * t, chroma * hue.cosine, chroma * hue.sine}; };
  double low = 0.0, high = 120.0;
  for (int i = 0; i < 40; ++i) (can_be_shown(lab(0.5 * (low + high))) ? low : high) = 0.5 * (low + high);
  return lab(std::min(0.9 * low, 75.0));
}

}  // namespace

std::array<std::uint8_t, 3> heat_color(double share) noexcept {
  const Vec3d c = linear_of(on_path(std::clamp(share, 0.0, 1.0)));
  const auto byte = [](double x) {
    return std::uint8_t(linear_to_srgb(float(std::clamp(x, 0.0, 1.0))) * 255.0f + 0.5f);
  };
  return {byte(c.x), byte(c.y), byte(c.z)};
}

}  // namespace arboretum
