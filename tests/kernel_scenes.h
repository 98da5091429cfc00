// Small scenes and rays for the tests that go over every row of the kernel table.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "core/mesh.h"
#include "core/random.h"
#include "core/ray.h"

namespace arboretum::test {

inline constexpr float kInfinity = std::numeric_limits<float>::infinity();

struct KernelScene {
  std::string name;
  TriangleMesh mesh;
};

[[nodiscard]] inline float uniform(std::uint64_t seed, std::uint64_t index, std::uint64_t dimension, float low,
                                   float high) {
  return low + (high - low) * random_float(seed, index, dimension);
}

[[nodiscard]] inline Vec3f uniform_point(std::uint64_t seed, std::uint64_t index, std::uint64_t dimension,
                                         const Bounds3f& box) {
  return {uniform(seed, index, dimension, box.lower.x, box.upper.x),
          uniform(seed, index, dimension + 1, box.lower.y, box.upper.y),
          uniform(seed, index, dimension + 2, box.lower.z, box.upper.z)};
}

/// `count` triangles of about `size`, spread over the cube [-1, 1]^3.
[[nodiscard]] inline TriangleMesh random_triangles(std::size_t count, float size, std::uint64_t seed) {
  const Bounds3f cube{{-1, -1, -1}, {1, 1, 1}};
  TriangleMesh mesh;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f center = uniform_point(seed, i, 0, cube);
    for (std::uint64_t k = 0; k < 3; ++k)
      mesh.vertices.push_back(center + size * uniform_point(seed, i, 3 + 3 * k, cube));
    const auto first = static_cast<std::uint32_t>(3 * i);
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

/// n x n quads of two triangles in the plane z = 0, over [-1, 1]^2.
[[nodiscard]] inline TriangleMesh flat_grid(std::uint32_t n) {
  TriangleMesh mesh;
  for (std::uint32_t y = 0; y <= n; ++y)
    for (std::uint32_t x = 0; x <= n; ++x)
      mesh.vertices.push_back({2.0f * float(x) / float(n) - 1, 2.0f * float(y) / float(n) - 1, 0});
  for (std::uint32_t y = 0; y < n; ++y) {
    for (std::uint32_t x = 0; x < n; ++x) {
      const std::uint32_t a = y * (n + 1) + x, b = a + 1, c = a + n + 1, d = c + 1;
      mesh.triangles.push_back({a, b, d});
      mesh.triangles.push_back({a, d, c});
    }
  }
  return mesh;
}

/// A closed sphere of radius 1: `rings` latitudes, twice as many longitudes, poles as fans; vertices shared.
[[nodiscard]] inline TriangleMesh sphere(std::uint32_t rings) {
  const std::uint32_t around = 2 * rings;
  const double pi = 3.14159265358979323846;
  TriangleMesh mesh;
  mesh.vertices.push_back({0, 0, 1});
  for (std::uint32_t r = 1; r < rings; ++r) {
    for (std::uint32_t k = 0; k < around; ++k) {
      const double theta = pi * r / rings, phi = 2 * pi * k / around;
      mesh.vertices.push_back(
          {float(std::sin(theta) * std::cos(phi)), float(std::sin(theta) * std::sin(phi)), float(std::cos(theta))});
    }
  }
  mesh.vertices.push_back({0, 0, -1});
  const auto last = static_cast<std::uint32_t>(mesh.vertices.size() - 1);
  const auto at = [&](std::uint32_t ring, std::uint32_t k) { return 1 + (ring - 1) * around + k % around; };
  for (std::uint32_t k = 0; k < around; ++k) {
    mesh.triangles.push_back({0, at(1, k), at(1, k + 1)});
    for (std::uint32_t r = 1; r + 1 < rings; ++r) {
      mesh.triangles.push_back({at(r, k), at(r + 1, k), at(r + 1, k + 1)});
      mesh.triangles.push_back({at(r, k), at(r + 1, k + 1), at(r, k + 1)});
    }
    mesh.triangles.push_back({at(rings - 1, k), last, at(rings - 1, k + 1)});
  }
  return mesh;
}

/// Each coordinate times `scale`, plus `offset`.
[[nodiscard]] inline TriangleMesh moved(TriangleMesh mesh, float scale, Vec3f offset = {}) {
  for (Vec3f& v : mesh.vertices) v = v * scale + offset;
  return mesh;
}

/// Every triangle `copies` times, the copies of one behind each other.
[[nodiscard]] inline TriangleMesh repeated(const TriangleMesh& mesh, std::size_t copies) {
  TriangleMesh result{mesh.vertices, {}, {}};
  for (const Triangle& t : mesh.triangles) result.triangles.insert(result.triangles.end(), copies, t);
  return result;
}

[[nodiscard]] inline std::vector<KernelScene> kernel_scenes() {
  std::vector<KernelScene> scenes;
  for (std::size_t n : {1u, 2u, 3u, 5u, 17u})
    scenes.push_back({"random " + std::to_string(n), random_triangles(n, 0.7f, 40 + n)});
  scenes.push_back({"random 100", random_triangles(100, 0.3f, 1)});
  scenes.push_back({"random 3000", random_triangles(3000, 0.1f, 2)});
  scenes.push_back({"flat grid", flat_grid(16)});
  scenes.push_back({"duplicates", repeated(random_triangles(20, 0.5f, 3), 9)});
  scenes.push_back({"one triangle a hundred times", repeated(random_triangles(1, 0.8f, 4), 100)});
  scenes.push_back({"sphere", sphere(12)});
  scenes.push_back({"sphere, far", moved(sphere(12), 1.0f, {1000, -2000, 500})});
  scenes.push_back({"large", moved(random_triangles(100, 0.3f, 5), 0x1p30f)});
  scenes.push_back({"small", moved(random_triangles(100, 0.3f, 6), 0x1p-30f)});
  TriangleMesh both = random_triangles(200, 0.2f, 7);
  for (const Vec3f& v : moved(random_triangles(4, 1.0f, 8), 1e6f).vertices) both.vertices.push_back(v);
  for (std::uint32_t i = 600; i < 612; i += 3) both.triangles.push_back({i, i + 1, i + 2});
  scenes.push_back({"two scales", both});
  return scenes;
}

/// Rays that meet nothing special: from around the scene through its inside, some short, some starting late,
/// some along an axis.
[[nodiscard]] inline std::vector<Ray> generic_rays(const TriangleMesh& mesh, std::size_t count, std::uint64_t seed) {
  const Bounds3f box = mesh.bounds();
  const Vec3f extent = box.extent();
  const float largest = std::max({extent.x, extent.y, extent.z});
  const Bounds3f around{box.lower - Vec3f{largest, largest, largest}, box.upper + Vec3f{largest, largest, largest}};
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f from = uniform_point(seed, i, 0, around), to = uniform_point(seed, i, 3, box);
    Ray ray{from, 0.0f, to - from, kInfinity};
    if (i % 7 == 1) ray.tfar = uniform(seed, i, 6, 0.2f, 2.0f);
    if (i % 7 == 2) ray.tnear = uniform(seed, i, 6, 0.2f, 1.2f);
    if (i % 7 == 3) {  // along an axis, through `to`
      const std::size_t axis = i / 7 % 3;
      const float sign = i % 2 ? 1.0f : -1.0f;
      ray.origin = to, ray.origin[axis] = to[axis] - sign * 2 * largest;
      ray.direction = i % 4 < 2 ? Vec3f{0, 0, 0} : Vec3f{-0.0f, -0.0f, -0.0f};
      ray.direction[axis] = sign * largest;
    }
    if (i % 7 == 4) ray.direction = normalize(ray.direction);
    rays.push_back(ray);
  }
  return rays;
}

/// Rays aimed at vertices and at points of edges, from `from`.
[[nodiscard]] inline std::vector<Ray> aimed_rays(const TriangleMesh& mesh, Vec3f from, std::size_t count,
                                                 std::uint64_t seed) {
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < count; ++i) {
    const auto c = mesh.corners(random_bits(seed, i, 0) % mesh.size());
    const std::size_t k = random_bits(seed, i, 1) % 3;
    const float s = random_float(seed, i, 2);
    const Vec3f at = i % 2 ? c[k] : c[k] * (1 - s) + c[(k + 1) % 3] * s;
    rays.push_back({from, 0.0f, at - from, kInfinity});
  }
  return rays;
}

/// Invalid rays: each must miss, whatever stands beside it.
[[nodiscard]] inline std::vector<Ray> invalid_rays() {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  return {
      {{nan, 0, 0}, 0, {0, 0, 1}, kInfinity},
      {{0, nan, nan}, 0, {0, 1, 1}, kInfinity},
      {{0, 0, -3}, 0, {0, nan, 1}, kInfinity},
      {{0, 0, -3}, nan, {0, 0, 1}, kInfinity},
      {{0, 0, -3}, 0, {0, 0, 1}, nan},
      {{nan, nan, nan}, nan, {nan, nan, nan}, nan},
      {{kInfinity, 0, 0}, 0, {-1, 0, 0}, kInfinity},
      {{0, 0, -kInfinity}, 0, {0, 0, 1}, kInfinity},
      {{0, 0, -3}, 0, {0, 0, kInfinity}, kInfinity},
      {{0, 0, -3}, 0, {-kInfinity, kInfinity, 1}, kInfinity},
      {{0, 0, 0}, 0, {0, 0, 0}, kInfinity},
      {{0, 0, 0}, 0, {-0.0f, 0, -0.0f}, kInfinity},
      {{0, 0, -3}, 9, {0, 0, 1}, 1},
      {{0, 0, -3}, 0, {0, 0, 1}, -kInfinity},
      {{0, 0, -3}, 0, {0, 0, 1}, -1},
      {{0, 0, -3}, kInfinity, {0, 0, 1}, 5},
  };
}

}  // namespace arboretum::test
