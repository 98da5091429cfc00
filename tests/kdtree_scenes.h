// Meshes that are hard for a kd-tree, and building one: what its tests share.
#pragma once

#include <cmath>
#include <memory>
#include <string_view>
#include <vector>

#include "structures/accel.h"
#include "tests/catch.h"
#include "tests/kernel_scenes.h"
#include "tests/small_meshes.h"

namespace arboretum::test::kd {

inline const char* const kBuilders[] = {"binned_sah", "sweep_sah"};

inline std::unique_ptr<Accel> build(const TriangleMesh& mesh, const char* builder, std::string_view leaf = "triangle4v",
                                    unsigned threads = 1, const BuilderParameters& parameters = {}) {
  BuildSettings settings;
  settings.builder = builder, settings.leaf = leaf, settings.threads = threads, settings.parameters = parameters;
  BuildReport report;
  auto accel = build_structure("kdtree", mesh, settings, report);
  CHECK(report.peak_bytes >= accel->bytes());
  CHECK(report.phases.size() >= (mesh.size() ? 3u : 1u));
  return accel;
}

/// Triangles that share the origin and reach in all directions: every plane through the middle cuts nearly all (B11).
inline TriangleMesh star(std::size_t count) {
  TriangleMesh mesh;
  Dice dice(11);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f tip = dice.point(), side = dice.point() * 0.05f;
    add_triangle(mesh, -tip, tip, tip + side);
  }
  return mesh;
}

/// Embree's TriangleSplitRegression (B15): bounds next to a bin border.
inline TriangleMesh split_regression() {
  const float a = -6.4000024f, b = 25.6f, c = 34.0f, d = 57.6000022f;
  TriangleMesh mesh;
  for (int turn = 0; turn < 3; ++turn) {
    const auto p = [&](float x, float y, float z) {
      const float v[3] = {x, y, z};
      return Vec3f{v[turn], v[(turn + 1) % 3], v[(turn + 2) % 3]};
    };
    add_triangle(mesh, p(a, a, a), p(b, a, a), p(b, b, c)), add_triangle(mesh, p(b, a, a), p(d, a, c), p(b, b, a));
    add_triangle(mesh, p(a, b, c), p(d, d, d), p(b, b, a)), add_triangle(mesh, p(b, b, b), p(b, d, c), p(b, a, d));
  }
  for (int i = 0; i < 40; ++i) {
    const float x = i % 2 ? b : std::nextafter(b, i % 3 ? a : d);
    add_triangle(mesh, {a, a, a + float(i)}, {x, b, c}, {i % 5 ? d : x, d, a});
  }
  return mesh;
}

inline TriangleMesh planes_at_integers(int count) {
  TriangleMesh mesh;
  for (int i = 0; i < count; ++i) {
    const auto x = float(i);
    add_triangle(mesh, {x, 0, 0}, {x, 1, 0}, {x, 0, 1}), add_triangle(mesh, {x, 1, 1}, {x, 1, 0}, {x, 0, 1});
  }
  return mesh;
}

inline TriangleMesh powers_of_two() {
  TriangleMesh mesh;
  for (int i = -38; i <= 38; ++i) {
    const float x = std::ldexp(1.0f, i), s = std::ldexp(1.0f, i - 2);
    for (int k = 0; k < 5; ++k)
      add_triangle(mesh, {x, 0, 0.01f * float(k) * s}, {x + s, 0, 0.01f * float(k) * s}, {x, s, 0.01f * float(k) * s});
  }
  return mesh;
}

inline TriangleMesh needles(std::size_t count) {
  TriangleMesh mesh;
  Dice dice(5);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f from = dice.point(), to = dice.point();
    add_triangle(mesh, from, to, to + dice.point() * 0.01f);
  }
  return mesh;
}

inline TriangleMesh points_and_one_triangle(std::size_t count) {
  TriangleMesh mesh;
  for (std::size_t i = 0; i < count; ++i) add_triangle(mesh, {1, 2, 3}, {1, 2, 3}, {1, 2, 3});
  add_triangle(mesh, {0, 0, 0}, {4, 0, 0}, {0, 4, 0});
  return mesh;
}

struct Scene {
  const char* name;
  TriangleMesh mesh;
};

inline std::vector<Scene> hard_scenes() {
  TriangleMesh outlier = random_triangles(2000, 0.01f, 11);
  add_triangle(outlier, {1e12f, 0, 0}, {1e12f, 1e6f, 0}, {1e12f, 0, 1e6f});
  return {{"random", random_triangles(1500, 0.1f, 1)},
          {"star", star(400)},
          {"split regression", split_regression()},
          {"flat grid", flat_grid(16)},
          {"planes at integers", planes_at_integers(200)},
          {"one triangle 1000 times", repeated(random_triangles(1, 0.8f, 4), 1000)},
          {"points and one triangle", points_and_one_triangle(3000)},
          {"powers of two", powers_of_two()},
          {"needles", needles(300)},
          {"outlier", outlier},
          {"far", moved(random_triangles(500, 0.1f, 3), 1.0f, {1e4f, -2e4f, 5e3f})},
          {"tiny", moved(random_triangles(300, 0.1f, 3), 0x1p-30f)}};
}

}  // namespace arboretum::test::kd
