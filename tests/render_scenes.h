// What the tests of rendering share: small scenes made of squares, and pictures of them by any row of the kernel table.
#pragma once

#include <algorithm>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>

#include "rendering/render.h"
#include "tests/catch.h"

namespace arboretum::test {

/// Adds the parallelogram a, a + u, a + u + v, a + v of a material; its front sees u turn to v counter-clockwise.
inline void add_square(Scene& scene, Vec3f a, Vec3f u, Vec3f v, std::uint16_t material = 0) {
  const auto first = std::uint32_t(scene.mesh.vertices.size());
  scene.mesh.vertices.insert(scene.mesh.vertices.end(), {a, a + u, a + u + v, a + v});
  scene.mesh.triangles.push_back({first, first + 1, first + 2});
  scene.mesh.triangles.push_back({first, first + 2, first + 3});
  scene.mesh.materials.insert(scene.mesh.materials.end(), 2, material);
}

/// The surface of a box, seen from without counter-clockwise.
inline void add_box(Scene& scene, Vec3f low, Vec3f high, std::uint16_t material = 0) {
  const Vec3f d = high - low, x{d.x, 0, 0}, y{0, d.y, 0}, z{0, 0, d.z};
  add_square(scene, low, y, x, material), add_square(scene, low + z, x, y, material);
  add_square(scene, low, x, z, material), add_square(scene, low + y, z, x, material);
  add_square(scene, low, z, y, material), add_square(scene, low + x, y, z, material);
}

/// A grey floor of 8 x 8 about the origin at y = 0, seen from above at a slant.
inline Scene floor_scene() {
  Scene scene;
  add_square(scene, {-4, 0, 4}, {8, 0, 0}, {0, 0, -8});
  scene.materials.push_back({.name = "grey", .diffuse = {0.5f, 0.5f, 0.5f}});
  scene.camera = Camera{.position = {0.3f, 3.1f, 5.2f}, .look_at = {0, 0.5f, 0}};
  return scene;
}

/// How a picture is traced.
struct Trace {
  std::string_view structure = "bvh8", traversal = "single", intersector = "watertight";
  Isa isa = best_isa();
};

/// Renders with a structure of the default builder; fails the test where there is no such row.
inline Picture picture_of(const Scene& scene, EffectSet effects, RenderSettings settings, Trace trace = {},
                          RenderStatistics* statistics = nullptr) {
  const RenderScene ready(scene, effects);
  if (ready.mesh().moves()) trace.structure = "bvh4_motion";
  const std::string_view below = trace.structure == "two_level" ? "bvh8" : trace.structure;
  const std::string_view leaf = default_leaf(below, trace.intersector, trace.isa);
  const KernelRow* row = find_kernel(trace.structure, leaf, trace.intersector, "padded", trace.traversal, trace.isa);
  INFO(trace.structure << " " << leaf << " " << trace.intersector << " " << trace.traversal);
  REQUIRE(row != nullptr);
  BuildSettings build;
  build.builder = find_structure(below)->info.builders.front(), build.leaf = leaf, build.isa = trace.isa;
  BuildReport report;
  const std::unique_ptr<Accel> accel = build_structure(trace.structure, ready.mesh(), build, report);
  const BatchTracer tracer(ready, *accel, *row);
  RenderStatistics own;
  const Picture picture = render(tracer, settings, own);
  CHECK(own.not_finite == 0);
  if (statistics) *statistics = own;
  return picture;
}

inline EffectSet detected(const Scene& scene) { return called_for(effects_of(scene)); }

/// Mean of a channel over the picture.
inline double mean(const Picture& picture, std::size_t channel = 0) {
  double sum = 0.0;
  for (const Vec3f& pixel : picture.pixels) sum += double(pixel[channel]);
  return sum / double(picture.pixels.size());
}

/// -0 and 0, and NaNs of different bits, are told apart.
inline bool same_bits(const Picture& a, const Picture& b) {
  return a.width == b.width && a.height == b.height && a.pixels.size() == b.pixels.size() &&
         std::memcmp(a.pixels.data(), b.pixels.data(), a.pixels.size() * sizeof(Vec3f)) == 0;
}

}  // namespace arboretum::test
