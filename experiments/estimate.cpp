#include "experiments/estimate.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <system_error>

#include "experiments/passes.h"
#include "scenes/catalogue.h"
#include "structures/builders/reinsertion_name.h"

namespace arboretum {
namespace {

/// What a scene is likely to hold, without loading it.
std::size_t expected_triangles(const SceneSpec& spec) {
  constexpr std::size_t kUnknown = 200'000, kBytesOfOne = 50;  // of a triangle in a file, roughly
  if (!spec.generator.empty()) return spec.triangles;
  if (!spec.catalogue.empty()) return find_catalogue_entry(spec.catalogue).triangles;
  std::error_code error;
  const std::uintmax_t bytes = spec.file.empty() ? 0 : std::filesystem::file_size(spec.file, error);
  return bytes == 0 || error ? kUnknown : std::size_t(bytes / kBytesOfOne) + 1;
}

/// Triangles a second of a builder with one thread, roughly (docs/performance.md); reinsertion after it not counted.
double triangles_per_second(std::string_view builder) {
  struct Rate {
    std::string_view builder;
    double rate;
  };
  static constexpr Rate kRates[] = {{"embree_high", 1.5e5}, {"high", 2e5},      {"embree_", 1e6},
                                    {"sweep_sah", 3.5e5},   {"ploc", 8e5},      {"morton", 4e6},
                                    {"low", 6e6},           {"octants", 4e5},   {"uniform", 2e6},
                                    {"two_level", 1e6},     {"binned_sah", 4e6}};
  for (const Rate& r : kRates)
    if (builder.starts_with(r.builder)) return r.rate;
  return 1.5e6;
}
constexpr double kReinsertedPerSecond = 7e5;

double build_seconds(const Cell& cell, double triangles) {
  return triangles / triangles_per_second(cell.builder) +
         (cell.builder.ends_with(kReinsertion) ? triangles / kReinsertedPerSecond : 0.0);
}

/// What several cells need once: each has its part, so that shards come out even.
class Shared {
 public:
  void add(std::size_t cell, const std::string& key, double seconds) {
    auto& [all, cells] = by_key_[key];
    all = seconds;
    cells.push_back(cell);
  }
  void share_out(std::vector<double>& seconds) const {
    for (const auto& [key, shared] : by_key_)
      for (std::size_t cell : shared.cells) seconds[cell] += shared.all / static_cast<double>(shared.cells.size());
  }

 private:
  struct Part {
    double all = 0.0;
    std::vector<std::size_t> cells;
  };
  std::map<std::string, Part> by_key_;
};

constexpr double kRaysPerSecond = 1e7;        ///< of a cell
constexpr double kLoadPerTriangle = 4e-6;     ///< of a scene and the oracle's tree
constexpr double kExactPerRay = 1e-6;         ///< exact answers, each of two kinds where rays start on surfaces
constexpr double kQualityOfBuild = 1.0;       ///< statistics of a structure, in builds
constexpr double kCheckPasses = 3.0;          ///< one whose answers are checked, one that counts and is slower
constexpr double kExtraPasses = 0.5 + 0.125;  ///< of a repetition: what min_time is exceeded by, and the untimed ones

}  // namespace

std::vector<double> estimate_seconds(const Experiment& experiment, const std::vector<Cell>& cells,
                                     const std::function<std::size_t(const Cell&)>& measured) {
  const MeasureSettings& m = experiment.measure;
  const double rays = double(m.width) * double(m.height), pass = rays / kRaysPerSecond;
  std::vector<double> triangles, seconds;
  for (const SceneChoice& scene : experiment.scenes) triangles.push_back(double(expected_triangles(scene.spec)));
  Shared shared;
  for (const Cell& cell : cells) {
    const double repetitions =
        m.repetitions - double(measured ? std::min<std::size_t>(measured(cell), m.repetitions) : 0);
    const double build = build_seconds(cell, triangles[cell.scene_index]);
    const std::size_t place = seconds.size();
    shared.add(place, cell.scene, kLoadPerTriangle * triangles[cell.scene_index]);
    if (cell.metric == Cell::Metric::build) {
      const double enough = std::min(m.min_time, kEnoughOfBuilds);
      seconds.push_back(build + std::max(2.0 * build, 0.5 * enough) + m.min_warmup_time +
                        repetitions * std::max(build, enough));
    } else {
      shared.add(place, fmt::format("{}/{}/{}/{}", cell.scene, cell.structure, cell.builder_name(), cell.leaf),
                 build * (1.0 + (experiment.metrics.quality ? kQualityOfBuild : 0.0)));
      shared.add(place, fmt::format("{}//{}", cell.scene, cell.workload_name()),
                 rays * kExactPerRay * (cell.workload == "primary" ? 1.0 : 2.0));
      seconds.push_back(kCheckPasses * pass + std::max(m.warmup * pass, m.min_warmup_time) +
                        std::max(2.0 * pass, 0.5 * m.min_time) +
                        repetitions * (std::max(m.min_time, pass) + kExtraPasses * pass));
    }
  }
  shared.share_out(seconds);
  return seconds;
}

}  // namespace arboretum
