// Environment: radiance from afar by direction: constant, or a latitude-longitude image with y up, its middle column
// towards -z and its columns going on towards +x.
//
// Directions towards an image are chosen by the luminance of its pixels (Pharr, Jakob, Humphreys, 3rd ed., 14.2.4),
// each pixel's being the most of its neighbours', so that what bilinear look-up shows is always found. A constant one
// needs no choosing: lobes find it best themselves.
#pragma once

#include <vector>

#include "scenes/images.h"
#include "scenes/vec3d.h"

namespace arboretum {

class Environment {
 public:
  Environment() = default;
  explicit Environment(Vec3f radiance) : constant_(radiance) {}
  /// An image of one colour is constant.
  explicit Environment(RadianceImage image);

  [[nodiscard]] bool is_constant() const noexcept { return image_.pixels.empty(); }
  /// From the unit direction, which points away from the scene.
  [[nodiscard]] Vec3f radiance(Vec3d direction) const noexcept;

  struct Sample {
    Vec3d direction;
    Vec3f radiance;
    double pdf = 0.0;  ///< by solid angle; 0: the image is black
  };
  /// A direction of an image from two numbers in [0, 1).
  [[nodiscard]] Sample sample(double u, double v) const noexcept;
  /// Density by which sample() chooses the direction.
  [[nodiscard]] double pdf(Vec3d direction) const noexcept;

 private:
  struct Place {
    double x, y;  ///< in pixels
  };
  [[nodiscard]] Place place(Vec3d direction) const noexcept;
  [[nodiscard]] double solid_angle(unsigned row) const noexcept;
  void make_table();

  Vec3f constant_{};
  RadianceImage image_;
  std::vector<double> up_to_;  ///< share of all pixels up to and with this one, row by row
};

}  // namespace arboretum
