// Vec3f: three floats, the project's only geometric value type below the scene side (which uses Eigen).
#pragma once

#include <cmath>
#include <cstddef>

namespace arboretum {

struct Vec3f {
  float x = 0.0f, y = 0.0f, z = 0.0f;

  [[nodiscard]] float operator[](std::size_t axis) const noexcept { return (&x)[axis]; }
  [[nodiscard]] float& operator[](std::size_t axis) noexcept { return (&x)[axis]; }
  friend bool operator==(const Vec3f&, const Vec3f&) = default;
};

[[nodiscard]] inline Vec3f operator+(Vec3f a, Vec3f b) noexcept { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
[[nodiscard]] inline Vec3f operator-(Vec3f a, Vec3f b) noexcept { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
[[nodiscard]] inline Vec3f operator-(Vec3f a) noexcept { return {-a.x, -a.y, -a.z}; }
[[nodiscard]] inline Vec3f operator*(Vec3f a, float s) noexcept { return {a.x * s, a.y * s, a.z * s}; }
[[nodiscard]] inline Vec3f operator*(float s, Vec3f a) noexcept { return a * s; }
[[nodiscard]] inline Vec3f operator*(Vec3f a, Vec3f b) noexcept { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
[[nodiscard]] inline Vec3f operator/(Vec3f a, float s) noexcept { return {a.x / s, a.y / s, a.z / s}; }

[[nodiscard]] inline float dot(Vec3f a, Vec3f b) noexcept { return a.x * b.x + a.y * b.y + a.z * b.z; }
[[nodiscard]] inline Vec3f cross(Vec3f a, Vec3f b) noexcept {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
[[nodiscard]] inline float length(Vec3f a) noexcept { return std::sqrt(dot(a, a)); }
/// `a` scaled to unit length; a zero vector gives NaN components.
[[nodiscard]] inline Vec3f normalize(Vec3f a) noexcept { return a / length(a); }
[[nodiscard]] inline bool is_finite(Vec3f a) noexcept {
  return std::isfinite(a.x) && std::isfinite(a.y) && std::isfinite(a.z);
}
[[nodiscard]] inline Vec3f min(Vec3f a, Vec3f b) noexcept {
  return {a.x < b.x ? a.x : b.x, a.y < b.y ? a.y : b.y, a.z < b.z ? a.z : b.z};
}
[[nodiscard]] inline Vec3f max(Vec3f a, Vec3f b) noexcept {
  return {a.x > b.x ? a.x : b.x, a.y > b.y ? a.y : b.y, a.z > b.z ? a.z : b.z};
}

}  // namespace arboretum
