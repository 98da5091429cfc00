// Ray, Hit and the conventions that every kernel keeps.
//
// A triangle is closed, so is the interval [tnear, tfar]; a coplanar or zero-area triangle is missed (in leaves of
// indices only by the tests in double and `exact`: docs/numerics.md); among hits at an equal t the lowest primitive id
// wins. A ray with a NaN, an infinite origin or direction, a zero direction or tnear > tfar hits nothing.
// tnear >= 0.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <type_traits>
#include <vector>

#include "core/vec3.h"

namespace arboretum {

/// 32 bytes: half a cache line. The direction need not be normalised; t is in units of its length.
struct alignas(16) Ray {
  Vec3f origin;
  float tnear = 0.0f;
  Vec3f direction;
  float tfar = std::numeric_limits<float>::infinity();
};
static_assert(sizeof(Ray) == 32);

inline constexpr std::uint32_t kNoPrimitive = 0xffffffffu;

/// 16 bytes. u weighs the triangle's second vertex, v its third. A miss: primitive == kNoPrimitive, t == infinity.
struct alignas(16) Hit {
  float t = std::numeric_limits<float>::infinity();
  float u = 0.0f;
  float v = 0.0f;
  std::uint32_t primitive = kNoPrimitive;

  [[nodiscard]] bool is_hit() const noexcept { return primitive != kNoPrimitive; }
};
static_assert(sizeof(Hit) == 16);

/// Whether the ray's numbers mean a ray at all; kernels report a miss for one that is not valid.
[[nodiscard]] inline bool is_valid(const Ray& ray) noexcept {
  return is_finite(ray.origin) && is_finite(ray.direction) &&
         (ray.direction.x != 0.0f || ray.direction.y != 0.0f || ray.direction.z != 0.0f) && ray.tnear <= ray.tfar;
}

/// What may be chosen of a way of traversal; kOwn: what the way itself has found best. No answer depends on it.
struct TraversalSettings {
  static constexpr unsigned kOwn = ~0u, kWidestHybrid = 16, kMostInFlight = 64;
  unsigned hybrid_threshold = kOwn;  ///< of hybrid4, 8, 16: so many rays in a node, or fewer, go on alone; 0: none ever
  unsigned rays_in_flight = kOwn;    ///< of queued: 1 to kMostInFlight
  [[nodiscard]] static constexpr unsigned chosen(unsigned set, unsigned own) noexcept {
    return set == kOwn ? own : set;
  }
  friend bool operator==(const TraversalSettings&, const TraversalSettings&) = default;
};

/// What a kernel is handed: rays, where the scene moves the time of each, and what is known of them all.
struct RayBatch {
  std::span<const Ray> rays;
  std::span<const float> times;  ///< within [0, 1], the time of the key frames; one a ray, or empty: 0 for all
  bool coherent = false;  ///< a hint: neighbours in `rays` take much the same way, as primary rays in tile order do
  TraversalSettings settings;

  RayBatch() = default;
  RayBatch(const Ray* first, std::size_t count) noexcept : rays(first, count) {}
  RayBatch(std::span<const Ray> r, std::span<const float> t) noexcept : rays(r), times(t) {}
  /// Of a vector, an array, a span.
  template <class Rays>
  requires std::is_convertible_v<const Rays&, std::span<const Ray>> RayBatch(const Rays& r)
  noexcept : rays(r) {}
  [[nodiscard]] std::size_t size() const noexcept { return rays.size(); }
  [[nodiscard]] const Ray& operator[](std::size_t i) const noexcept { return rays[i]; }
  /// `count` rays from ray `begin` on.
  [[nodiscard]] RayBatch part(std::size_t begin, std::size_t count) const noexcept {
    RayBatch b(rays.subspan(begin, count), times.empty() ? times : times.subspan(begin, count));
    b.coherent = coherent, b.settings = settings;
    return b;
  }
  [[nodiscard]] float time(std::size_t i) const noexcept { return times.empty() ? 0.0f : times[i]; }
};

}  // namespace arboretum
