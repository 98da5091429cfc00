#include "scenes/rescale.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include <fmt/format.h>

#include "core/instances.h"

namespace arboretum {
namespace {

constexpr int kExponent = 40;        ///< promises hold for largest coordinates within 2^-40 .. 2^40
constexpr std::size_t kStray = 100;  ///< one triangle of so many far out is a stray one
constexpr int kLeastNormalExponent = std::numeric_limits<float>::min_exponent - 1;
static_assert(kMaxCoordinate == float(std::uint64_t{1} << kExponent));

/// What the coordinates of all triangles span, in all key frames; those with a corner that is not finite do not count.
struct Span {
  /// |coordinate|, of the smallest that is not 0
  float largest = 0.0f, smallest = std::numeric_limits<float>::infinity();
  std::size_t triangles = 0, out_of_range = 0;
};

Span span_of(const TriangleMesh& mesh) {
  Span span;
  for (const Triangle& t : mesh.triangles) {
    float largest = 0.0f, smallest = std::numeric_limits<float>::infinity();
    bool finite = true;
    for (std::size_t k = 0; k < mesh.frames(); ++k) {
      for (const std::uint32_t corner : {t.a, t.b, t.c}) {
        const Vec3f v = mesh.frame(k)[corner];
        for (int axis = 0; axis < 3; ++axis) {
          const float size = std::abs(v[axis]);
          finite &= std::isfinite(size);
          largest = std::max(largest, size);
          if (size > 0.0f) smallest = std::min(smallest, size);
        }
      }
    }
    if (!finite) continue;
    ++span.triangles, span.out_of_range += largest > kMaxCoordinate;
    span.largest = std::max(span.largest, largest), span.smallest = std::min(span.smallest, smallest);
  }
  return span;
}

Vec3f scaled(Vec3f v, int exponent) {
  return {std::ldexp(v.x, exponent), std::ldexp(v.y, exponent), std::ldexp(v.z, exponent)};
}

/// The power of two to multiply by, where that is called for and exact.
std::optional<int> exponent_for(const Span& span) {
  if (!(span.largest > 0.0f)) return {};
  const int below_one = -1 - std::ilogb(span.largest);
  if (span.largest < std::ldexp(1.0f, -kExponent)) return below_one;
  if (span.out_of_range * kStray <= span.triangles) return {};
  // Down no farther than the smallest coordinate can go.
  const int exponent = std::max(below_one, kLeastNormalExponent - std::ilogb(span.smallest));
  if (exponent >= 0 || std::ldexp(span.largest, exponent) > kMaxCoordinate) return {};
  return exponent;
}

bool is_in_range(const Span& span, int exponent) {
  const float largest = std::ldexp(span.largest, exponent);
  return largest >= std::ldexp(1.0f, -kExponent) && largest <= kMaxCoordinate;
}

bool stays_exact(const Span& span, int exponent) {
  return exponent >= 0 || std::ilogb(span.smallest) + exponent >= kLeastNormalExponent;
}

/// A prototype that is then in range is scaled itself, and its maps stay what they are but for the translation;
/// of the others the maps are scaled.
std::shared_ptr<const Instancing> rescaled(const Instancing& instancing, int exponent) {
  auto result = std::make_shared<Instancing>(instancing);
  std::vector<bool> follows;
  for (TriangleMesh& prototype : result->prototypes) {
    const Span span = span_of(prototype);
    follows.push_back(is_in_range(span, exponent) && stays_exact(span, exponent));
    if (!follows.back()) continue;
    for (Vec3f& v : prototype.vertices) v = scaled(v, exponent);
  }
  for (Instance& instance : result->instances) {
    for (auto& row : instance.to_world.m)
      for (int k = follows[instance.prototype] ? 3 : 0; k < 4; ++k) row[k] = std::ldexp(row[k], exponent);
  }
  return result;
}

/// Puts every corner where its instance's map has it, with the bits that subnormal numbers had lost.
void lay_out_again(TriangleMesh& mesh) {
  for (const Instance& instance : mesh.instancing->instances) {
    const TriangleMesh& prototype = mesh.instancing->prototypes[instance.prototype];
    const bool moved = !is_identity(instance.to_world);
    for (std::size_t i = 0; i < prototype.size(); ++i) {
      const std::array<Vec3f, 3> from = prototype.corners(i);
      const Triangle& to = mesh.triangles[instance.first_primitive + i];
      const std::uint32_t corners[3] = {to.a, to.b, to.c};
      for (std::size_t k = 0; k < 3; ++k)
        mesh.vertices[corners[k]] = moved ? transform_point(instance.to_world, from[k]) : from[k];
    }
  }
}

}  // namespace

void rescale(Scene& scene, const std::string& source) {
  const Span span = span_of(scene.mesh);
  const std::optional<int> exponent = exponent_for(span);
  if (!exponent) return;
  const auto scale = [&](Vec3f& v) { v = scaled(v, *exponent); };
  for (Vec3f& v : scene.mesh.vertices) scale(v);
  for (std::vector<Vec3f>& frame : scene.mesh.later_frames)
    for (Vec3f& v : frame) scale(v);
  if (scene.mesh.instancing) {
    scene.mesh.instancing = rescaled(*scene.mesh.instancing, *exponent);
    if (*exponent > 0) lay_out_again(scene.mesh);
  }
  if (scene.camera) {
    scale(scene.camera->position), scale(scene.camera->look_at);
    for (float* length : {&scene.camera->aperture_radius, &scene.camera->focus_distance})
      *length = std::ldexp(*length, *exponent);
  }
  for (Light& light : scene.lights) {
    scale(light.position);
    // It falls with the square of the distance
    if (light.type != Light::Type::directional) scale(light.intensity), scale(light.intensity);
  }
  scene.report.scaled_by = *exponent;
  scene.report.warnings.push_back(fmt::format(
      "{}: the largest coordinate is {:.3g}, outside of 2^-{} to 2^{}; the scene is multiplied by 2^{}, which is exact",
      source, span.largest, kExponent, kExponent, *exponent));
}

}  // namespace arboretum
