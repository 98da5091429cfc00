#include "rendering/render.h"

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <mutex>
#include <sstream>
#include <thread>

#include "core/error.h"
#include "core/names.h"
#include "core/timer.h"
#include "rendering/camera_rays.h"
#include "rendering/path_wave.h"
#include "rendering/pixels.h"
#include "rendering/simple_wave.h"

namespace arboretum {
namespace {

constexpr unsigned kTile = 32;             // pixels a side
constexpr unsigned kSamplesTogether = 16;  // of a pixel: 16 384 paths a wave

/// Radiance of the camera rays of some samples.
void trace_wave(const BatchTracer& tracer, const RenderSettings& settings, PathWave& paths, TracedRays& rays,
                std::span<Vec3d> radiance, RenderStatistics& statistics) {
  switch (settings.integrator) {
    case Integrator::path:
    case Integrator::whitted: return paths.trace(rays, radiance, statistics);
    case Integrator::ambient_occlusion: return trace_ambient_occlusion(tracer, rays, radiance, statistics);
    case Integrator::normals: return trace_normals(tracer, rays, radiance, statistics);
  }
}

/// The pixels of a tile, all their samples added up in order.
void render_tile(const BatchTracer& tracer, const RenderSettings& settings, unsigned x, unsigned y, Picture& picture,
                 RenderStatistics& statistics) {
  const double begin = thread_cpu_seconds();
  const CameraRays camera(tracer.scene(), settings);
  PathWave paths(tracer, settings);
  TracedRays rays;
  std::vector<Vec3d> radiance, sums(std::size_t(kTile) * kTile);
  const auto place = [&](const PixelSample& s) { return std::size_t(s.y - y) * kTile + (s.x - x); };
  for (unsigned first = 0; first < settings.samples; first += kSamplesTogether) {
    const std::vector<PixelSample> samples =
        camera.samples(x, y, kTile, first, std::min(first + kSamplesTogether, settings.samples));
    rays.clear();
    camera.add(samples, rays);
    radiance.assign(samples.size(), {});
    trace_wave(tracer, settings, paths, rays, radiance, statistics);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (std::isfinite(radiance[i].x) && std::isfinite(radiance[i].y) && std::isfinite(radiance[i].z))
        sums[place(samples[i])] = sums[place(samples[i])] + radiance[i];
      else
        ++statistics.not_finite;
    }
  }
  for (unsigned py = y; py < std::min(y + kTile, settings.height); ++py) {
    for (unsigned px = x; px < std::min(x + kTile, settings.width); ++px)
      picture.pixels[std::size_t(py) * settings.width + px] =
          to_float(sums[place({px, py, 0})] * (1.0 / settings.samples));
  }
  statistics.seconds += thread_cpu_seconds() - begin;
}

}  // namespace

void check(const RenderSettings& s) {
  check_resolution(s.width, s.height);
  if (s.samples < 1 || s.samples > 65536)
    throw UserError(std::to_string(s.samples) + " samples a pixel are not possible; 1 to 65536 are");
  if (s.integrator == Integrator::whitted && s.depth > kMaxWhittedDepth)
    throw UserError("depth " + std::to_string(s.depth) +
                    " is not possible for whitted, which follows every branch; 0 to " +
                    std::to_string(kMaxWhittedDepth) + " are");
  if (!(s.clamp > 0.0f)) {
    std::ostringstream shortest;
    shortest << s.clamp;
    throw UserError("a clamp of " + shortest.str() + " is not possible; one above 0 is, or none");
  }
}

Integrator parse_integrator(const std::string& word) {
  return Integrator(index_of_name("integrator", word, kIntegratorNames));
}

Picture render(const BatchTracer& tracer, const RenderSettings& settings, RenderStatistics& statistics,
               const RenderProgress& progress) {
  check(settings);
  Picture picture{settings.width, settings.height, std::vector<Vec3f>(std::size_t(settings.width) * settings.height)};
  const unsigned across = (settings.width + kTile - 1) / kTile,
                 tiles = across * ((settings.height + kTile - 1) / kTile);
  std::mutex mutex;
  unsigned done = 0;
  const unsigned cores = std::max(1u, std::thread::hardware_concurrency());
  const tbb::global_control allowed(tbb::global_control::max_allowed_parallelism, std::max(cores, settings.threads));
  tbb::task_arena arena(settings.threads == 0 ? tbb::task_arena::automatic : int(settings.threads));
  arena.execute([&] {
    tbb::parallel_for(0u, tiles, [&](unsigned tile) {
      RenderStatistics own;
      render_tile(tracer, settings, tile % across * kTile, tile / across * kTile, picture, own);
      const std::scoped_lock lock(mutex);
      statistics += own;
      if (progress) progress(double(++done) / tiles);
    });
  });
  return picture;
}

}  // namespace arboretum
