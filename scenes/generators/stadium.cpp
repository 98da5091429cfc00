// teapot_in_stadium: a pot of about one unit, with lid, spout and handle, in the middle of a stadium 1 000
// 000 units wide. Half of the triangles are the pot's: the classic hard case for structures that divide space
// evenly.
#include <array>

#include "scenes/generators/generators.h"
#include "scenes/generators/surface.h"

namespace arboretum {
namespace {

/// Catmull-Rom curve through points, at parameter t in [0, 1]; its ends are the first and the last point.
template <std::size_t N>
Vec3d curve(const std::array<Vec3d, N>& points, double t) {
  const double s = std::clamp(t, 0.0, 1.0) * double(N - 1);
  const auto i = std::min<std::size_t>(std::size_t(s), N - 2);
  const double f = s - double(i);
  const Vec3d p1 = points[i], p2 = points[i + 1];
  const Vec3d p0 = i > 0 ? points[i - 1] : p1, p3 = i + 2 < N ? points[i + 2] : p2;
  return p1 + (p2 - p0) * (0.5 * f) + (p0 * 2.0 - p1 * 5.0 + p2 * 4.0 - p3) * (0.5 * f * f) +
         (p1 * 3.0 - p0 - p2 * 3.0 + p3) * (0.5 * f * f * f);
}

/// A tube around a curve in the plane z = 0; its radius closes at both ends like a hemisphere's.
template <std::size_t N>
void add_tube(MeshBuilder& builder, std::size_t count, const std::array<Vec3d, N>& points, double thick, double thin) {
  builder.add_closed(count, 4.0, 1, [&](double v, double turns) {
    const Vec3d center = curve(points, v);
    constexpr double kStep = 1.0 / 256.0;
    const Vec3d along = normalize(curve(points, v + kStep) - curve(points, v - kStep));
    const double end = std::min({1.0, v * 16.0, (1.0 - v) * 16.0});
    const double radius = (thick + (thin - thick) * v) * std::sqrt(std::max(0.0, end * (2.0 - end)));
    const UnitCircle circle(turns);
    const Vec3d across{-along.y, along.x, 0.0};
    return center + (across * circle.cosine + Vec3d{0, 0, 1} * circle.sine) * radius;
  });
}

void add_pot(MeshBuilder& builder, std::size_t count) {
  constexpr double kFloor = 0.01;  // the pot stands on nothing: no face lies in the field's plane
  const std::size_t tube = count >= 60 ? count / 6 & ~std::size_t{1} : 0;
  // Profile of body, lid and knob: radius and height, from the middle of the bottom to the top of the knob.
  const std::array<Vec3d, 13> profile{{{0, 0, 0},
                                       {0.22, 0, 0},
                                       {0.36, 0.05, 0},
                                       {0.45, 0.18, 0},
                                       {0.46, 0.30, 0},
                                       {0.39, 0.44, 0},
                                       {0.31, 0.54, 0},
                                       {0.30, 0.56, 0},
                                       {0.18, 0.61, 0},
                                       {0.06, 0.64, 0},
                                       {0.045, 0.68, 0},
                                       {0.07, 0.73, 0},
                                       {0, 0.76, 0}}};
  builder.add_closed(count - 2 * tube, 0.45, 1, [&](double v, double turns) {
    const Vec3d p = curve(profile, v);
    const UnitCircle circle(turns);
    const double radius = std::max(0.0, p.x);
    return Vec3d{radius * circle.cosine, kFloor + p.y, -radius * circle.sine};
  });
  if (tube == 0) return;
  const std::array<Vec3d, 5> spout{
      {{0.36, 0.16, 0}, {0.52, 0.20, 0}, {0.60, 0.34, 0}, {0.66, 0.48, 0}, {0.76, 0.56, 0}}};
  const std::array<Vec3d, 6> handle{
      {{-0.34, 0.50, 0}, {-0.52, 0.53, 0}, {-0.68, 0.48, 0}, {-0.70, 0.34, 0}, {-0.58, 0.20, 0}, {-0.40, 0.14, 0}}};
  add_tube(builder, tube, spout, 0.10, 0.045);
  add_tube(builder, tube, handle, 0.042, 0.042);
}

}  // namespace

Scene generate_teapot_in_stadium(std::size_t triangles, std::uint64_t) {
  MeshBuilder builder;
  constexpr double kHalfWidth = 500'000.0, kHalfDepth = 380'000.0, kInner = 0.6, kRise = 120'000.0;
  const std::size_t pot = triangles >= 12 ? triangles / 2 & ~std::size_t{1} : 0;
  const std::size_t around = triangles - pot;
  const std::size_t field = around < 24 ? around : around / 8;
  builder.add_patch(field, kHalfWidth / kHalfDepth, 0, [&](double u, double v) {
    return Vec3d{(2.0 * u - 1.0) * kHalfWidth, 0.0, (1.0 - 2.0 * v) * kHalfDepth};
  });
  if (const std::size_t stands = around - field; stands > 0) {
    // Terraces: the height goes up in steps while the radius goes out evenly, as many as the rows can show.
    const double steps = std::clamp(std::floor(std::sqrt(double(stands) / 16.0) * 0.25), 1.0, 60.0);
    builder.add_patch(stands, 8.0, 2, [&](double u, double v) {
      const UnitCircle circle(1.0 - u);
      const double step = std::floor(v * steps), inside = v * steps - step;
      const double rise = (step + std::min(1.0, inside * 4.0)) / steps;  // a quarter riser, three quarters tread
      const double out = (step + std::max(0.0, (inside - 0.2) / 0.8)) / steps;
      const double scale = kInner + (1.0 - kInner) * out;
      return Vec3d{kHalfWidth * scale * circle.cosine, 1000.0 + kRise * rise, -kHalfDepth * scale * circle.sine};
    });
  }
  if (pot > 0) add_pot(builder, pot);

  Scene scene;
  scene.mesh = builder.take();
  scene.materials.push_back(Material{.name = "grass", .diffuse = {0.2f, 0.4f, 0.15f}});
  scene.materials.push_back(
      Material{.name = "china", .diffuse = {0.7f, 0.7f, 0.75f}, .specular = {0.04f, 0.04f, 0.04f}, .roughness = 0.05f});
  scene.materials.push_back(Material{.name = "stands", .diffuse = {0.5f, 0.5f, 0.5f}});
  scene.camera = Camera{.position = {0.5f, 0.75f, 2.1f}, .look_at = {0.03f, 0.4f, 0.0f}, .vertical_fov = 45};
  scene.lights.push_back(Light{.position = {2, 4, 3}, .intensity = {30, 30, 30}});
  return scene;
}

}  // namespace arboretum
