// Images that scenes refer to: their pixels, their mean radiance, and whether they hold anything but one value.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/vec3.h"

namespace arboretum {

/// Linear radiance, rows downwards.
struct RadianceImage {
  unsigned width = 0, height = 0;
  std::vector<Vec3f> pixels;
};
/// Why `image` cannot be read: "no such file", "no image of a kind that is read: …", "broken or truncated: …". Empty
/// where it can.
[[nodiscard]] std::string fault_of_image(const std::filesystem::path& image);
/// HDR as it is, PNG, JPEG … made linear. Throws UserError where it cannot be read or holds values that are not finite.
[[nodiscard]] RadianceImage read_radiance(const std::filesystem::path& image);
/// Mean over all directions of a latitude-longitude image.
[[nodiscard]] Vec3f mean_radiance(const RadianceImage& image);

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
