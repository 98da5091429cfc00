#include "rendering/texture.h"

#include <algorithm>
#include <cmath>

#include "rendering/transfer.h"
#include "scenes/vec3d.h"

namespace arboretum {

Texture::Texture(const Image& image) : width_(image.width), height_(image.height) {
  std::array<float, 256> linear{};
  for (std::size_t i = 0; i < linear.size(); ++i) linear[i] = srgb_to_linear(float(i) / 255.0f);
  const bool grey = image.channels < 3;
  bool has_alpha = false;
  for (std::size_t i = 0; i < image.pixels.size() && image.channels % 2 == 0; i += image.channels)
    has_alpha = has_alpha || image.pixels[i + image.channels - 1] != 255;
  Vec3d sum;
  double opacity = 0.0;
  texels_.reserve(std::size_t(width_) * height_);
  for (std::size_t i = 0; i < image.pixels.size(); i += image.channels) {
    const std::uint8_t* p = image.pixels.data() + i;
    const std::uint8_t r = p[0], g = grey ? p[0] : p[1], b = grey ? p[0] : p[2];
    Texel texel{{linear[r], linear[g], linear[b]}, float(r + g + b) / (3.0f * 255.0f)};
    if (has_alpha) texel.opacity = float(p[image.channels - 1]) / 255.0f;
    sum = sum + Vec3d(texel.color), opacity += double(texel.opacity);
    texels_.push_back(texel);
    constant_ = constant_ && texel == texels_.front();
  }
  // A sum of equal numbers is not always a multiple of them.
  mean_color_ = constant_ ? texels_.front().color : to_float(sum * (1.0 / double(texels_.size())));
  mean_opacity_ = constant_ ? texels_.front().opacity : float(opacity / double(texels_.size()));
}

Texture::Texel Texture::at(std::array<float, 2> coordinates) const noexcept {
  const auto place = [](float coordinate, unsigned size, unsigned(&pixels)[2]) {
    const double within = double(coordinate) - std::floor(double(coordinate));
    const double position = (std::isfinite(within) ? within : 0.0) * size - 0.5, first = std::floor(position);
    pixels[0] = unsigned((std::int64_t(first) + size) % size), pixels[1] = (pixels[0] + 1) % size;
    return float(position - first);
  };
  unsigned x[2], y[2];
  const float along_x = place(coordinates[0], width_, x), along_y = place(1.0f - coordinates[1], height_, y);
  const auto texel = [&](int i, int j) -> const Texel& { return texels_[std::size_t(y[j]) * width_ + x[i]]; };
  const auto mix = [&](auto&& of) {
    const auto above = of(texel(0, 0)) * (1.0f - along_x) + of(texel(1, 0)) * along_x;
    const auto below = of(texel(0, 1)) * (1.0f - along_x) + of(texel(1, 1)) * along_x;
    return above * (1.0f - along_y) + below * along_y;
  };
  return {mix([](const Texel& t) { return t.color; }), mix([](const Texel& t) { return t.opacity; })};
}

Vec3f Texture::color(std::array<float, 2> coordinates) const noexcept { return at(coordinates).color; }
float Texture::opacity(std::array<float, 2> coordinates) const noexcept { return at(coordinates).opacity; }

}  // namespace arboretum
