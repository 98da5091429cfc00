// fractal_terrain: a height field of ridged value noise (after Musgrave 1993: octaves weighted by the ones
// below).
#include "core/random.h"
#include "scenes/generators/generators.h"
#include "scenes/generators/surface.h"

namespace arboretum {
namespace {

/// Smooth noise in [-1, 1], one independent field an octave.
double value_noise(std::uint64_t seed, std::uint64_t octave, double x, double y) {
  const double fx = std::floor(x), fy = std::floor(y);
  const auto cell_x = std::uint64_t(std::int64_t(fx)), cell_y = std::uint64_t(std::int64_t(fy));
  const auto corner = [&](std::uint64_t i, std::uint64_t j) {
    return 2.0 * random_double(seed, (cell_x + i) << 32 | ((cell_y + j) & 0xffffffffu), octave) - 1.0;
  };
  const auto fade = [](double t) { return t * t * t * (t * (t * 6.0 - 15.0) + 10.0); };
  const double u = fade(x - fx), v = fade(y - fy);
  const double lower = corner(0, 0) * (1.0 - u) + corner(1, 0) * u, upper = corner(0, 1) * (1.0 - u) + corner(1, 1) * u;
  return lower * (1.0 - v) + upper * v;
}

double height(std::uint64_t seed, int octaves, double u, double v) {
  double sum = 0.0, amplitude = 0.5, frequency = 3.0, weight = 1.0;
  for (int octave = 0; octave < octaves; ++octave) {
    const double ridge = 1.0 - std::abs(value_noise(seed, std::uint64_t(octave), u * frequency, v * frequency));
    const double signal = ridge * ridge * weight;
    sum += signal * amplitude;
    weight = std::clamp(signal * 1.6, 0.0, 1.0);
    amplitude *= 0.5, frequency *= 2.03;
  }
  return sum;
}

}  // namespace

Scene generate_fractal_terrain(std::size_t triangles, std::uint64_t seed) {
  // Detail down to about two triangles.
  int octaves = 3;
  while (octaves < 14 && (std::size_t{1} << (2 * octaves)) < triangles) ++octaves;
  constexpr double kHeight = 0.55;
  MeshBuilder builder;
  builder.add_patch(triangles, 1.0, 0, [&](double u, double v) {
    return Vec3d{2.0 * u - 1.0, kHeight * height(seed, octaves, u, v), 1.0 - 2.0 * v};
  });
  Scene scene;
  scene.mesh = builder.take();
  scene.materials.push_back(Material{.name = "rock", .diffuse = {0.5f, 0.45f, 0.4f}});
  scene.camera = Camera{.position = {0.75f, 0.95f, 1.35f}, .look_at = {-0.05f, 0.2f, 0.0f}};
  scene.lights.push_back(Light{.position = {-3, 3, 1}, .intensity = {20, 20, 18}});
  return scene;
}

}  // namespace arboretum
