// Small meshes and random numbers for tests.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/mesh.h"
#include "core/random.h"

namespace arboretum {

/// Random numbers in sequence, for generators that draw as many as they like.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) : seed_(seed) {}
  float uniform(float low = -1.0f, float high = 1.0f) { return low + (high - low) * random_float(seed_, next_++, 0); }
  int integer(int count) { return static_cast<int>(random_bits(seed_, next_++, 1) % static_cast<unsigned>(count)); }
  /// Signed, the logarithm uniform in base 2: from 2^low to 2^high.
  float exponential(float low, float high) {
    const float size = std::exp2(uniform(low, high));
    return integer(2) == 0 ? size : -size;
  }
  Vec3f point() { return {uniform(), uniform(), uniform()}; }

 private:
  std::uint64_t seed_, next_ = 0;
};

/// Adds a triangle with three vertices of its own.
inline void add_triangle(TriangleMesh& mesh, Vec3f a, Vec3f b, Vec3f c) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  mesh.vertices.insert(mesh.vertices.end(), {a, b, c});
  mesh.triangles.push_back({first, first + 1, first + 2});
}

/// A closed sphere of latitude and longitude, its vertices shared or one a corner.
inline TriangleMesh sphere(int rings, int segments, bool shared) {
  TriangleMesh mesh;
  const auto at = [&](int r, int s) {
    const double theta = 3.141592653589793 * r / rings, phi = 6.283185307179586 * (s % segments) / segments;
    if (r == 0 || r == rings) return Vec3f{0, 0, r == 0 ? 1.0f : -1.0f};
    return Vec3f{float(std::sin(theta) * std::cos(phi)), float(std::sin(theta) * std::sin(phi)),
                 float(std::cos(theta))};
  };
  for (int r = 0; r < rings; ++r) {
    for (int s = 0; s < segments; ++s) {
      if (r + 1 < rings) add_triangle(mesh, at(r, s), at(r + 1, s), at(r + 1, s + 1));
      if (r > 0) add_triangle(mesh, at(r, s), at(r + 1, s + 1), at(r, s + 1));
    }
  }
  if (!shared) return mesh;
  TriangleMesh welded;
  for (Triangle t : mesh.triangles) {
    for (std::uint32_t* v : {&t.a, &t.b, &t.c}) {
      const Vec3f p = mesh.vertices[*v];
      const auto found = std::find(welded.vertices.begin(), welded.vertices.end(), p);
      *v = static_cast<std::uint32_t>(found - welded.vertices.begin());
      if (found == welded.vertices.end()) welded.vertices.push_back(p);
    }
    welded.triangles.push_back(t);
  }
  return welded;
}

}  // namespace arboretum
