#include "scenes/images.h"

#include <algorithm>
#include <cstring>
#include <memory>

#define STB_IMAGE_IMPLEMENTATION
#define STB_IMAGE_STATIC
#include <stb/stb_image.h>

#include "core/error.h"
#include "scenes/file_bytes.h"
#include "scenes/vec3d.h"

namespace arboretum {

std::string fault_of_image(const std::filesystem::path& image) {
  std::error_code error;
  const auto status = std::filesystem::status(image, error);
  if (!std::filesystem::exists(status)) return "no such file";
  if (!std::filesystem::is_regular_file(status)) return "no regular file";
  int width = 0, height = 0, channels = 0;
  const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(stbi_load(image.c_str(), &width, &height, &channels, 0),
                                                         stbi_image_free);
  if (pixels) return {};
  const std::string reason = stbi_failure_reason();
  if (reason == "unknown image type")
    return "no image of a kind that is read, which are PNG, JPEG, BMP, TGA, GIF, PSD, PNM, PIC and HDR";
  if (reason == "can't fopen") return "cannot be opened";
  return "broken or truncated: " + reason;
}

RadianceImage read_radiance(const std::filesystem::path& image) {
  check_readable_file(image);
  int width = 0, height = 0, channels = 0;
  const std::unique_ptr<float, void (*)(void*)> pixels(stbi_loadf(image.c_str(), &width, &height, &channels, 3),
                                                       stbi_image_free);
  if (!pixels) throw UserError(image.string() + ": " + fault_of_image(image));
  RadianceImage read{unsigned(width), unsigned(height), {}};
  read.pixels.resize(std::size_t(width) * std::size_t(height));
  for (std::size_t i = 0; i < read.pixels.size(); ++i) {
    const float* p = pixels.get() + 3 * i;
    read.pixels[i] = {p[0], p[1], p[2]};
    if (!is_finite(read.pixels[i])) throw UserError(image.string() + ": holds values that are not finite");
  }
  return read;
}

Vec3f mean_radiance(const RadianceImage& image) {
  Vec3d sum;
  double weights = 0.0;
  for (unsigned y = 0; y < image.height; ++y) {
    const double weight = UnitCircle(0.5 * (y + 0.5) / image.height).sine;  // solid angle of the row's pixels
    for (unsigned x = 0; x < image.width; ++x)
      sum = sum + Vec3d(image.pixels[std::size_t(y) * image.width + x]) * weight;
    weights += weight * image.width;
  }
  return to_float(sum * (1.0 / weights));
}

std::optional<Image> read_image(const std::filesystem::path& image) {
  if (std::error_code error; !std::filesystem::is_regular_file(image, error)) return std::nullopt;  // a pipe would wait
  int width = 0, height = 0, channels = 0;
  const std::unique_ptr<stbi_uc, void (*)(void*)> pixels(stbi_load(image.c_str(), &width, &height, &channels, 0),
                                                         stbi_image_free);
  if (!pixels) return std::nullopt;
  Image read{unsigned(width), unsigned(height), unsigned(channels), {}};
  read.pixels.assign(pixels.get(), pixels.get() + std::size_t(width) * std::size_t(height) * std::size_t(channels));
  return read;
}

std::optional<ValueRange> value_range(const std::filesystem::path& path) {
  const std::optional<Image> image = read_image(path);
  if (!image) return std::nullopt;
  ValueRange range;
  const std::size_t stride = image->channels;
  for (std::size_t i = 0; i < image->pixels.size(); i += stride) {
    const std::uint8_t* p = image->pixels.data() + i;
    for (std::size_t c = 0; c < stride; ++c) {
      range.least = std::min(range.least, float(p[c]) / 255.0f);
      range.greatest = std::max(range.greatest, float(p[c]) / 255.0f);
    }
    range.constant = range.constant && std::memcmp(p, image->pixels.data(), stride) == 0;
  }
  return range;
}

}  // namespace arboretum
