#include "scenes/rescale.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>

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

}  // namespace

void rescale(Scene& scene, const std::string& source) {
  const Span span = span_of(scene.mesh);
  const std::optional<int> exponent = exponent_for(span);
  if (!exponent) return;
  const auto scaled = [&](float x) { return std::ldexp(x, *exponent); };
  const auto scale = [&](Vec3f& v) { v = {scaled(v.x), scaled(v.y), scaled(v.z)}; };
  for (Vec3f& v : scene.mesh.vertices) scale(v);
  for (std::vector<Vec3f>& frame : scene.mesh.later_frames)
    for (Vec3f& v : frame) scale(v);
  if (scene.mesh.instancing) {
    auto instancing = std::make_shared<Instancing>(*scene.mesh.instancing);
    for (Instance& instance : instancing->instances)
      for (auto& row : instance.to_world.m)
        for (double& m : row) m = std::ldexp(m, *exponent);
    scene.mesh.instancing = std::move(instancing);
  }
  if (scene.camera) {
    scale(scene.camera->position), scale(scene.camera->look_at);
    scene.camera->aperture_radius = scaled(scene.camera->aperture_radius),
    scene.camera->focus_distance = scaled(scene.camera->focus_distance);
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
