// random_triangles and needles: soups, no vertex shared.
#include <algorithm>

#include "core/random.h"
#include "scenes/generators/generators.h"
#include "scenes/sanitise.h"
#include "scenes/vec3d.h"

namespace arboretum {
namespace {

/// Random numbers of one triangle, drawn in order.
class Draw {
 public:
  Draw(std::uint64_t seed, std::uint64_t index) : seed_(seed), index_(index) {}
  double operator()(double low, double high) { return low + (high - low) * random_double(seed_, index_, dimension_++); }
  Vec3d in_cube(double half) {
    const double x = (*this)(-half, half), y = (*this)(-half, half), z = (*this)(-half, half);
    return {x, y, z};
  }
  /// Uniform in the unit ball without its centre.
  Vec3d in_ball() {
    while (true) {
      const Vec3d p = in_cube(1.0);
      if (const double square = dot(p, p); square <= 1.0 && square > 1e-6) return p;
    }
  }
  Vec3d direction() { return normalize(in_ball()); }

 private:
  std::uint64_t seed_, index_, dimension_ = 0;
};

/// Fills a mesh with `count` triangles; one that rounds to zero area is drawn anew.
template <class Corners>
TriangleMesh soup(std::size_t count, std::uint64_t seed, const Corners& corners) {
  TriangleMesh mesh;
  mesh.vertices.reserve(3 * count);
  mesh.triangles.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    Draw draw(seed, i);
    std::array<Vec3f, 3> t;
    do {
      const std::array<Vec3d, 3> exact = corners(draw);
      for (std::size_t k = 0; k < 3; ++k) t[k] = to_float(exact[k]);
    } while (has_zero_area(t[0], t[1], t[2]));
    const auto first = std::uint32_t(3 * i);
    mesh.vertices.insert(mesh.vertices.end(), t.begin(), t.end());
    mesh.triangles.push_back({first, first + 1, first + 2});
  }
  return mesh;
}

/// By Newton's method: cbrt of the C library may differ in the last bit from machine to machine.
double cube_root(double x) {
  double y = std::max(x, 1.0);
  for (int i = 0; i < 100; ++i) y -= (y - x / (y * y)) / 3.0;
  return y;
}

Scene scene_around(TriangleMesh mesh) {
  Scene scene;
  scene.mesh = std::move(mesh);
  scene.materials.push_back(Material{.name = "matt", .diffuse = {0.6f, 0.6f, 0.6f}});
  scene.camera = Camera{.position = {1.7f, 1.3f, 2.6f}, .look_at = {0, 0, 0}, .vertical_fov = 45};
  scene.lights.push_back(Light{.position = {3, 5, 4}, .intensity = {40, 40, 40}});
  return scene;
}

}  // namespace

Scene generate_random_triangles(std::size_t triangles, std::uint64_t seed) {
  // The edge grows as the spacing of the centres, so every count is about as crowded as every other.
  const double size = 1.5 / cube_root(double(triangles));
  return scene_around(soup(triangles, seed, [size](Draw& draw) {
    const Vec3d center = draw.in_cube(1.0);
    const Vec3d a = draw.in_ball(), b = draw.in_ball(), c = draw.in_ball();
    return std::array{center + a * size, center + b * size, center + c * size};
  }));
}

Scene generate_needles(std::size_t triangles, std::uint64_t seed) {
  // Thin enough that a ray passes some ten of them whatever the count; 200 times as long as wide at least.
  const double width = std::min(1.0 / 500.0, 160.0 / double(triangles));
  return scene_around(soup(triangles, seed, [width](Draw& draw) {
    const Vec3d middle = draw.in_cube(0.8);
    const Vec3d along = draw.direction();
    const double half = draw(0.2, 0.4);
    const Vec3d across = normalize(cross(along, Frame(along).to_world(draw.direction()) + Frame(along).tangent * 1e-3));
    return std::array{middle - along * half, middle + along * half, middle + along * half + across * width};
  }));
}

}  // namespace arboretum
