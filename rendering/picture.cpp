#include "rendering/picture.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <sstream>

#define STB_IMAGE_WRITE_IMPLEMENTATION
#define STB_IMAGE_WRITE_STATIC
#define STBI_WRITE_NO_STDIO
#include <stb/stb_image_write.h>

#include "core/error.h"
#include "core/whole_file.h"
#include "rendering/luminance.h"
#include "rendering/transfer.h"

namespace arboretum {
namespace {

/// Of squares of kBlock pixels a side, so that noise does not count as darkness; black ones left out.
std::vector<double> block_luminances(const Picture& picture) {
  constexpr unsigned kBlock = 8;
  std::vector<double> blocks;
  for (unsigned y = 0; y < picture.height; y += kBlock) {
    for (unsigned x = 0; x < picture.width; x += kBlock) {
      double sum = 0.0;
      const unsigned below = std::min(y + kBlock, picture.height), right = std::min(x + kBlock, picture.width);
      for (unsigned v = y; v < below; ++v)
        for (unsigned u = x; u < right; ++u) sum += luminance(picture.pixels[std::size_t(v) * picture.width + u]);
      if (sum > 0.0) blocks.push_back(sum / double((below - y) * (right - x)));
    }
  }
  return blocks;
}

std::string pfm(const Picture& picture) {
  std::string bytes = "PF\n" + std::to_string(picture.width) + " " + std::to_string(picture.height) +
                      (std::endian::native == std::endian::little ? "\n-1.0\n" : "\n1.0\n");
  for (unsigned y = picture.height; y-- > 0;)  // rows upwards
    bytes.append(reinterpret_cast<const char*>(picture.pixels.data() + std::size_t(y) * picture.width),
                 picture.width * sizeof(Vec3f));
  return bytes;
}

}  // namespace

double auto_exposure(const Picture& picture) {
  std::vector<double> blocks = block_luminances(picture);
  if (blocks.empty()) return 0.0;
  const auto quarter_from_top = blocks.begin() + std::ptrdiff_t(3 * (blocks.size() - 1) / 4);
  std::ranges::nth_element(blocks, quarter_from_top);
  return std::round(4.0 * std::clamp(std::log2(0.5 / *quarter_from_top), -60.0, 60.0)) / 4.0;
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

void write_png(const std::filesystem::path& path, unsigned width, unsigned height,
               const std::vector<std::uint8_t>& rgb) {
  check_png_size(width, height);
  std::string bytes;
  const auto append = [](void* to, void* data, int size) {
    static_cast<std::string*>(to)->append(static_cast<const char*>(data), std::size_t(size));
  };
  if (stbi_write_png_to_func(append, &bytes, int(width), int(height), 3, rgb.data(), int(width) * 3) == 0)
    throw UserError(path.string() + ": the picture is too large for a PNG");
  write_whole(path, bytes);
}

void check_exposure(double stops) {
  if (std::fabs(stops) <= kMaxStops) return;
  std::ostringstream shortest;
  shortest << stops;
  throw UserError("an exposure of " + shortest.str() + " stops is not possible; -300 to 300 are");
}

void write_picture(const std::filesystem::path& path, const Picture& picture, double stops) {
  check_exposure(stops);
  check_picture_path(path);
  if (path.extension() == ".pfm")
    write_whole(path, pfm(picture));
  else
    write_png(path, picture.width, picture.height, develop(picture, stops));
}

void check_picture_path(const std::filesystem::path& path) {
  if (path.extension() != ".png" && path.extension() != ".pfm")
    throw UserError(path.string() + ": pictures are written as .png, or .pfm for radiance in float32");
  const std::filesystem::path folder = path.parent_path();
  if (std::error_code error; !folder.empty() && !std::filesystem::is_directory(folder, error))
    throw UserError(folder.string() + ": no such folder; make it first, or write elsewhere with --out");
  require_writable(path);
}

void check_png_size(unsigned width, unsigned height) {
  // The encoder counts bytes in int, and its growing buffer's capacity more than doubles
  constexpr std::uint64_t kMost = 1u << 30;
  const std::uint64_t bytes = (std::uint64_t(3) * width + 1) * height;
  if (bytes > kMost)
    throw UserError(std::to_string(width) + " x " + std::to_string(height) +
                    " pixels are too many for a .png, which may hold 2^30 bytes; .pfm holds pictures of any size");
}

}  // namespace arboretum
