// Images that scenes refer to: their pixels, their mean radiance, and whether they hold anything but one value.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "core/vec3.h"

namespace arboretum {

/// Mean over all directions of a latitude-longitude image (HDR, PNG, JPEG …). Throws UserError.
[[nodiscard]] Vec3f mean_radiance(const std::filesystem::path& image);

/// Least and greatest value of any channel of an image, 0 to 1; nothing where it cannot be read.
struct ValueRange {
  float least = 1.0f, greatest = 0.0f;
  bool constant = true;  ///< every pixel has the first one's colour
};
[[nodiscard]] std::optional<ValueRange> value_range(const std::filesystem::path& image);

/// Eight bits a channel, rows downwards; 1 to 4 channels: grey, grey and alpha, RGB, RGBA.
struct Image {
  unsigned width = 0, height = 0, channels = 0;
  std::vector<std::uint8_t> pixels;
};
/// Nothing where it cannot be read.
[[nodiscard]] std::optional<Image> read_image(const std::filesystem::path& image);

}  // namespace arboretum
