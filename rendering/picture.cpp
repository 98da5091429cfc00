#include "rendering/picture.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <fstream>

#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#define STBI_WRITE_NO_STDIO
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wmissing-field-initializers"
#endif
#include <stb/stb_image_write.h>
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif

#include "core/error.h"
#include "rendering/transfer.h"

namespace arboretum {
namespace {

/// Of linear Rec. 709 colours.
double luminance(Vec3f c) { return 0.2126 * double(c.x) + 0.7152 * double(c.y) + 0.0722 * double(c.z); }

double mean_log_luminance(const Picture& picture, double most) {
  double sum = 0.0;
  std::size_t count = 0;
  for (const Vec3f& pixel : picture.pixels) {
    const double y = std::min(luminance(pixel), most);
    if (y > 0.0) sum += std::log2(y), ++count;
  }
  return count > 0 ? sum / double(count) : std::log2(0.18);
}

void write_bytes(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), std::streamsize(bytes.size()));
  file.close();
  if (!file) throw UserError(path.string() + ": cannot be written; is there space, and may you write there?");
}

std::string pfm(const Picture& picture) {
  std::string bytes = "PF\n" + std::to_string(picture.width) + " " + std::to_string(picture.height) +
                      (std::endian::native == std::endian::little ? "\n-1.0\n" : "\n1.0\n");
  for (unsigned y = picture.height; y-- > 0;)  // rows upwards
    bytes.append(reinterpret_cast<const char*>(picture.pixels.data() + std::size_t(y) * picture.width), picture.width * sizeof(Vec3f));
  return bytes;
}

}  // namespace

double auto_exposure(const Picture& picture) {
  const double first = mean_log_luminance(picture, 1e300);
  const double mean = mean_log_luminance(picture, std::exp2(first + 4.0));
  return std::round(4.0 * std::clamp(std::log2(0.18) - mean, -60.0, 60.0)) / 4.0;
}

std::vector<std::uint8_t> develop(const Picture& picture, double stops) {
  const auto scale = float(std::exp2(stops));
  std::vector<std::uint8_t> bytes;
  bytes.reserve(3 * picture.pixels.size());
  for (const Vec3f& pixel : picture.pixels) {
    for (std::size_t channel = 0; channel < 3; ++channel) {
      const float exposed = pixel[channel] * scale;
      const float clipped = exposed > 0.0f ? std::min(exposed, 1.0f) : 0.0f;
      bytes.push_back(std::uint8_t(linear_to_srgb(clipped) * 255.0f + 0.5f));
    }
  }
  return bytes;
}

void write_png(const std::filesystem::path& path, unsigned width, unsigned height, const std::vector<std::uint8_t>& rgb) {
  std::string bytes;
  const auto append = [](void* to, void* data, int size) {
    static_cast<std::string*>(to)->append(static_cast<const char*>(data), std::size_t(size));
  };
  if (stbi_write_png_to_func(append, &bytes, int(width), int(height), 3, rgb.data(), int(width) * 3) == 0)
    throw UserError(path.string() + ": the picture is too large for a PNG");
  write_bytes(path, bytes);
}

void write_picture(const std::filesystem::path& path, const Picture& picture, double stops) {
  check_picture_path(path);
  if (path.extension() == ".pfm")
    write_bytes(path, pfm(picture));
  else
    write_png(path, picture.width, picture.height, develop(picture, stops));
}

void check_picture_path(const std::filesystem::path& path) {
  if (path.extension() != ".png" && path.extension() != ".pfm")
    throw UserError(path.string() + ": pictures are written as .png, or .pfm for radiance in float32");
  const std::filesystem::path folder = path.parent_path();
  if (std::error_code error; !folder.empty() && !std::filesystem::is_directory(folder, error))
    throw UserError(folder.string() + ": no such folder; make it first, or write elsewhere with --out");
}

}  // namespace arboretum
