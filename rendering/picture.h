// Picture: radiance by pixel, and what becomes of it in a file: exposure, transfer, eight bits.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/vec3.h"

namespace arboretum {

/// Linear radiance, rows downwards.
struct Picture {
  unsigned width = 0, height = 0;
  std::vector<Vec3f> pixels;
  friend bool operator==(const Picture&, const Picture&) = default;
};

/// Stops that suit the picture: three quarters of it, black parts left out, come to be below half of white. Rounded to
/// quarters of a stop; 0 for a black picture.
[[nodiscard]] double auto_exposure(const Picture& picture);

/// Eight bits a channel, RGB: radiance times 2^stops, clipped to [0, 1] in each channel, by the sRGB transfer function.
/// No other tone mapping: equal radiance has equal colours in every picture of the same exposure.
[[nodiscard]] std::vector<std::uint8_t> develop(const Picture& picture, double stops);

/// Stops at most, either way: 2^300 and its inverse span all that float32 holds.
inline constexpr double kMaxStops = 300.0;
/// Throws UserError for stops that are no number within kMaxStops.
void check_exposure(double stops);

/// Writes .png (developed) or .pfm (the radiance itself, float32, exposure not applied). Throws UserError for another
/// extension, where it cannot be written, and as check_exposure() does.
void write_picture(const std::filesystem::path& path, const Picture& picture, double stops);
/// As a .png, of bytes that are colours already, rows downwards. Throws UserError.
void write_png(const std::filesystem::path& path, unsigned width, unsigned height,
               const std::vector<std::uint8_t>& rgb);
/// Throws UserError for an extension that write_picture does not know, a folder that is not there, or a file that
/// cannot be written: before any work.
void check_picture_path(const std::filesystem::path& path);
/// Throws UserError where write_png could not hold so many pixels: before any work.
void check_png_size(unsigned width, unsigned height);

}  // namespace arboretum
