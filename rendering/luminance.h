// Luminance of linear colours with the primaries of sRGB (Rec. 709).
#pragma once

#include "core/vec3.h"

namespace arboretum {

[[nodiscard]] inline double luminance(Vec3f c) noexcept {
  return 0.2126 * double(c.x) + 0.7152 * double(c.y) + 0.0722 * double(c.z);
}

}  // namespace arboretum
