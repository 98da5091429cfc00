#include "rendering/environment.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "rendering/directions.h"
#include "rendering/luminance.h"

namespace arboretum {

Environment::Environment(RadianceImage image) : image_(std::move(image)) {
  const auto differs = [&](const Vec3f& pixel) { return pixel != image_.pixels.front(); };
  if (std::ranges::any_of(image_.pixels, differs)) {
    make_table();
    return;
  }
  constant_ = image_.pixels.front();
  image_ = {};
}

double Environment::solid_angle(unsigned row) const noexcept {
  const double height = image_.height;
  const double above = UnitCircle(0.5 * row / height).cosine, below = UnitCircle(0.5 * (row + 1) / height).cosine;
  return 2.0 * std::numbers::pi * (above - below) / image_.width;
}

void Environment::make_table() {
  const unsigned width = image_.width, height = image_.height;
  up_to_.resize(image_.pixels.size());
  double sum = 0.0;
  for (unsigned y = 0; y < height; ++y) {
    const double angle = solid_angle(y);
    for (unsigned x = 0; x < width; ++x) {
      double most = 0.0;
      for (unsigned row = y > 0 ? y - 1 : 0; row <= std::min(y + 1, height - 1); ++row)
        for (const unsigned column : {(x + width - 1) % width, x, (x + 1) % width})
          most = std::max(most, luminance(image_.pixels[std::size_t(row) * width + column]));
      up_to_[std::size_t(y) * width + x] = sum += most * angle;
    }
  }
  for (double& share : up_to_) share = sum > 0.0 ? share / sum : 0.0;
}

Environment::Place Environment::place(Vec3d d) const noexcept {
  const double turns = 0.5 + std::atan2(d.x, -d.z) / (2.0 * std::numbers::pi);
  const double down = std::acos(std::clamp(d.y, -1.0, 1.0)) / std::numbers::pi;
  return {turns * image_.width, down * image_.height};
}

Vec3f Environment::radiance(Vec3d direction) const noexcept {
  if (is_constant()) return constant_;
  const auto [x, y] = place(direction);
  const double left = std::floor(x - 0.5), top = std::floor(y - 0.5);
  const auto along_x = float(x - 0.5 - left), along_y = float(y - 0.5 - top);
  const auto pixel = [&](double column, double row) {
    const auto c = std::size_t((std::int64_t(column) + image_.width) % image_.width);
    const auto r = std::size_t(std::clamp(row, 0.0, double(image_.height - 1)));
    return image_.pixels[r * image_.width + c];
  };
  const Vec3f above = pixel(left, top) * (1.0f - along_x) + pixel(left + 1, top) * along_x;
  const Vec3f below = pixel(left, top + 1) * (1.0f - along_x) + pixel(left + 1, top + 1) * along_x;
  return above * (1.0f - along_y) + below * along_y;
}

Environment::Sample Environment::sample(double u, double v) const noexcept {
  const auto chosen = std::size_t(std::ranges::upper_bound(up_to_, u) - up_to_.begin());
  if (chosen == up_to_.size()) return {};
  const double before = chosen == 0 ? 0.0 : up_to_[chosen - 1], share = up_to_[chosen] - before;
  const auto column = double(chosen % image_.width);
  const auto row = unsigned(chosen / image_.width);
  // Within the pixel: what is left of u along the row, v by equal areas from above.
  const double turns = (column + (u - before) / share) / image_.width + 0.5;
  const double top = UnitCircle(0.5 * row / image_.height).cosine,
               bottom = UnitCircle(0.5 * (row + 1.0) / image_.height).cosine;
  const double up = top + (bottom - top) * v, across = std::sqrt(std::max(0.0, 1.0 - up * up));
  const UnitCircle angle(turns);
  const Vec3d direction{across * angle.sine, up, -across * angle.cosine};
  return {direction, radiance(direction), share / solid_angle(row)};
}

double Environment::pdf(Vec3d direction) const noexcept {
  const auto [x, y] = place(direction);
  const auto column = std::min(unsigned(x), image_.width - 1), row = std::min(unsigned(y), image_.height - 1);
  const std::size_t i = std::size_t(row) * image_.width + column;
  return (up_to_[i] - (i == 0 ? 0.0 : up_to_[i - 1])) / solid_angle(row);
}

}  // namespace arboretum
