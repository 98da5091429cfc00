// Hashes of meshes and rays, bit by bit, for tests that hold what generators make.
#pragma once

#include <bit>
#include <cstdint>

#include "core/instances.h"
#include "core/random.h"
#include "oracle/hard_rays.h"

namespace arboretum::test {

struct GoldenHash {
  std::uint64_t value = 0;

  void add(std::uint64_t word) { value = mix64(value ^ word); }
  void add(Vec3f v) {
    for (const float x : {v.x, v.y, v.z}) add(std::bit_cast<std::uint32_t>(x));
  }
  /// Key frames and instances count where there are some.
  void add(const TriangleMesh& mesh) {
    for (const Vec3f& v : mesh.vertices) add(v);
    for (const Triangle& t : mesh.triangles) add(t.a), add(t.b), add(t.c);
    for (const std::uint16_t m : mesh.materials) add(m);
    for (const auto& frame : mesh.later_frames)
      for (const Vec3f& v : frame) add(v);
    if (!mesh.instancing) return;
    for (const TriangleMesh& prototype : mesh.instancing->prototypes) add(prototype);
    for (const Instance& instance : mesh.instancing->instances) {
      add(instance.prototype), add(instance.first_primitive);
      for (const auto& row : instance.to_world.m)
        for (const double x : row) add(std::bit_cast<std::uint64_t>(x));
    }
  }
  void add(const HardRays& made) {
    for (const Ray& ray : made.rays) {
      add(ray.origin), add(std::bit_cast<std::uint32_t>(ray.tnear));
      add(ray.direction), add(std::bit_cast<std::uint32_t>(ray.tfar));
    }
    for (const float time : made.times) add(std::bit_cast<std::uint32_t>(time));
    for (const HardKind kind : made.kinds) add(static_cast<std::uint64_t>(kind));
    for (const std::uint32_t source : made.sources) add(source);
  }
};

}  // namespace arboretum::test
