// Texture: an image looked up at texture coordinates, repeated over the plane, bilinear between pixels' centres.
// Colours are taken as sRGB and come out linear; opacity is taken as it is stored.
#pragma once

#include <array>
#include <vector>

#include "core/vec3.h"
#include "scenes/images.h"

namespace arboretum {

class Texture {
 public:
  explicit Texture(const Image& image);

  /// Linear, at texture coordinates (u, v), v upwards.
  [[nodiscard]] Vec3f color(std::array<float, 2> at) const noexcept;
  /// The image's alpha channel where that is not 1 all over, else the mean of its colours as stored.
  [[nodiscard]] float opacity(std::array<float, 2> at) const noexcept;
  [[nodiscard]] Vec3f mean_color() const noexcept { return mean_color_; }
  [[nodiscard]] float mean_opacity() const noexcept { return mean_opacity_; }
  /// All pixels are alike.
  [[nodiscard]] bool is_constant() const noexcept { return constant_; }

 private:
  struct Texel {
    Vec3f color;
    float opacity = 1.0f;
    friend bool operator==(const Texel&, const Texel&) = default;
  };
  [[nodiscard]] Texel at(std::array<float, 2> coordinates) const noexcept;

  unsigned width_, height_;
  std::vector<Texel> texels_;
  Vec3f mean_color_;
  float mean_opacity_ = 1.0f;
  bool constant_ = true;
};

}  // namespace arboretum
