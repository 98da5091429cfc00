// render(): a picture of a scene by one of the integrators, every ray through one row of the kernel table.
//
// The picture depends on scene, effects, settings and what the kernel answers alone: not on the number of threads, nor
// on which structure and way of traversal give the answers.
#pragma once

#include <array>
#include <functional>
#include <limits>
#include <string>
#include <string_view>

#include "rendering/batch_tracer.h"
#include "rendering/picture.h"
#include "rendering/ray_kinds.h"

namespace arboretum {

enum class Integrator : unsigned char {
  path,     ///< path tracing with next-event estimation (Kajiya 1986), multiple importance sampling (Veach 1997)
  whitted,  ///< direct light; mirrors and glass followed both ways (Whitted 1980)
  ambient_occlusion,  ///< how much of a white sky within a fifth of the scene's diagonal each point sees
  normals             ///< the geometric normal as a colour
};
inline constexpr std::array<std::string_view, 4> kIntegratorNames{"path", "whitted", "ambient_occlusion", "normals"};
[[nodiscard]] constexpr std::string_view to_string(Integrator i) noexcept { return kIntegratorNames[std::size_t(i)]; }
/// Throws UserError, naming the nearest.
[[nodiscard]] Integrator parse_integrator(const std::string& word);

/// Scatterings of a path of `whitted` at most: the number of a node doubles with each hit.
inline constexpr unsigned kMaxWhittedDepth = 32;

struct RenderSettings {
  Integrator integrator = Integrator::path;
  unsigned width = 512, height = 512;
  unsigned samples = 16;  ///< a pixel
  unsigned depth = 32;    ///< scatterings of a path at most; 1: direct light. Paths end by chance from the fourth on.
  float clamp = std::numeric_limits<float>::infinity();  ///< most light that one sample's path brings at once from
                                                         ///< beyond its first hit
  std::uint64_t seed = 1;
  unsigned threads = 1;  ///< 0: one a core
};

/// Told how much is done, within [0, 1]; may be called from several threads, one at a time.
using RenderProgress = std::function<void(double)>;

/// Throws UserError for a size or count of 0, or beyond 65 536; a depth that `whitted` cannot follow; a clamp that is
/// not above 0.
void check(const RenderSettings& settings);
/// What `tracer` holds must be ready for rays. Throws UserError as check() does.
[[nodiscard]] Picture render(const BatchTracer& tracer, const RenderSettings& settings, RenderStatistics& statistics,
                             const RenderProgress& progress = {});

}  // namespace arboretum
