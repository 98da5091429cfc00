// waving_cloth: a curtain with a travelling wave, a closed ball that flies past it and turns, a ground that stands
// still; five key frames.
#include "scenes/generators/generators.h"
#include "scenes/generators/surface.h"

namespace arboretum {
namespace {

constexpr std::size_t kFrames = 5, kSmallestScene = 40;

TriangleMesh at(std::size_t triangles, double time) {
  MeshBuilder builder;
  const std::size_t ball = triangles >= kSmallestScene ? MeshBuilder::closed_count(triangles / 5) : 0;
  const std::size_t ground = triangles >= 3 ? 2 : 0;
  builder.add_patch(triangles - ball - ground, 4.0 / 3.0, 0, [&](double u, double v) {
    // Fixed along the rod (v = 1); the wave grows downwards.
    const UnitCircle wave(2.5 * u + 0.4 * v - 0.12 * time), slow(0.7 * u + 0.06 * time);
    const double swing = 1.0 - v * v;
    return Vec3d{4.0 * u - 2.0 + 0.1 * swing * slow.cosine, 0.2 + 3.0 * v,
                 (0.08 + 0.3 * swing) * wave.sine + 0.4 * swing * slow.sine};
  });
  if (ball > 0) {
    const Vec3d center{-1.2 + 0.5 * time, 1.5 + 0.2 * time * (1.0 - time), 1.1};
    builder.add_closed(ball, 0.5, 1, [&](double v, double turns) {
      const UnitCircle latitude(0.5 * v), longitude(turns), roll(-0.1 * time);
      const Vec3d p{latitude.sine * longitude.cosine, -latitude.cosine, -latitude.sine * longitude.sine};
      return center + Vec3d{p.x * roll.cosine - p.y * roll.sine, p.x * roll.sine + p.y * roll.cosine, p.z} * 0.45;
    });
  }
  if (ground > 0) {
    builder.add_patch(ground, 1.0, 2, [](double u, double v) { return Vec3d{10.0 * u - 5.0, 0.0, 5.0 - 10.0 * v}; });
  }
  return builder.take();
}

}  // namespace

Scene generate_waving_cloth(std::size_t triangles, std::uint64_t) {
  Scene scene;
  scene.mesh = at(triangles, 0.0);
  for (std::size_t k = 1; k < kFrames; ++k)
    scene.mesh.later_frames.push_back(at(triangles, double(k) / double(kFrames - 1)).vertices);
  scene.key_frames = kFrames;
  scene.shutter = {0.0f, 1.0f};
  scene.materials.push_back(Material{.name = "cloth", .diffuse = {0.6f, 0.2f, 0.2f}});
  scene.materials.push_back(Material{.name = "ball", .diffuse = {0.2f, 0.3f, 0.6f}});
  scene.materials.push_back(Material{.name = "floor", .diffuse = {0.5f, 0.5f, 0.5f}});
  scene.camera = Camera{.position = {1.5f, 2.2f, 6.0f}, .look_at = {0, 1.5f, 0}, .vertical_fov = 42};
  scene.lights.push_back(Light{.position = {3, 6, 4}, .intensity = {60, 60, 60}});
  return scene;
}

}  // namespace arboretum
