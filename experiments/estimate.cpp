#include "experiments/estimate.h"

#include <algorithm>
#include <string_view>

#include "experiments/runner.h"
#include "scenes/catalogue.h"

namespace arboretum {
namespace {

/// What a scene is likely to hold, without loading it.
std::size_t expected_triangles(const SceneSpec& spec) {
  constexpr std::size_t kUnknown = 200'000;
  if (!spec.generator.empty()) return spec.triangles;
  return spec.catalogue.empty() ? kUnknown : find_catalogue_entry(spec.catalogue).triangles;
}

/// Triangles a second of a builder with one thread, roughly (docs/performance.md); reinsertion after it not counted.
double triangles_per_second(std::string_view builder) {
  struct Rate {
    std::string_view builder;
    double rate;
  };
  static constexpr Rate kRates[] = {{"embree_high", 1.5e5}, {"high", 2e5},     {"embree_", 1e6}, {"sweep_sah", 3.5e5},
                                    {"ploc", 8e5},          {"morton", 4e6},   {"low", 6e6},     {"octants", 4e5},
                                    {"uniform", 2e6},       {"two_level", 1e6}};
  for (const Rate& r : kRates)
    if (builder.starts_with(r.builder)) return r.rate;
  return 1.5e6;
}
constexpr double kReinsertedPerSecond = 7e5;

}  // namespace

/// Repetitions last min_time; making a cell ready takes a few passes at ten million rays a second.
std::vector<double> estimate_seconds(const Experiment& experiment, const std::vector<Cell>& cells,
                                     const std::function<std::size_t(const Cell&)>& measured) {
  const MeasureSettings& m = experiment.measure;
  const double pass = double(m.width) * double(m.height) / 1e7;
  std::vector<double> triangles, seconds;
  for (const SceneChoice& scene : experiment.scenes) triangles.push_back(double(expected_triangles(scene.spec)));
  for (const Cell& cell : cells) {
    const double repetitions =
        m.repetitions - double(measured ? std::min<std::size_t>(measured(cell), m.repetitions) : 0);
    if (cell.metric == Cell::Metric::build) {
      const double a_triangle = 1.0 / triangles_per_second(cell.builder) +
                                (cell.builder.ends_with("_reinsertion") ? 1.0 / kReinsertedPerSecond : 0.0);
      seconds.push_back((1.0 + repetitions) * triangles[cell.scene_index] * a_triangle + m.min_warmup_time);
    } else {
      seconds.push_back(repetitions * std::max(m.min_time, pass) + 3.0 * pass +
                        std::max(m.warmup * pass, m.min_warmup_time));
    }
  }
  return seconds;
}

}  // namespace arboretum
