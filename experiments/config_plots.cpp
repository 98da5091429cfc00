#include "experiments/config_plots.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <iterator>

#include "core/names.h"

namespace arboretum {
namespace {

template <class Predicate>
bool has_workload(const Experiment& experiment, const Predicate& wanted) {
  const auto has = [&](const AxisLists& axes) { return std::ranges::any_of(axes[index_of(Axis::workload)], wanted); };
  return has(experiment.axes) ||
         std::ranges::any_of(experiment.include, [&](const CellChoice& c) { return has(c.axes); });
}

/// The metrics that a plot shows.
struct Shown {
  bool (*are_measured)(const Metrics&);
  std::string_view words;
};
constexpr Shown traced{[](const Metrics& m) { return m.trace; }, "trace"};
constexpr Shown built{[](const Metrics& m) { return m.build; }, "build"};
constexpr Shown of_quality{[](const Metrics& m) { return m.quality; }, "quality"};
constexpr Shown traced_or_built{[](const Metrics& m) { return m.trace || m.build; }, "trace or build"};
constexpr Shown traced_and_built{[](const Metrics& m) { return m.trace && m.build; }, "trace and build"};
constexpr Shown traced_of_quality{[](const Metrics& m) { return m.trace && m.quality; }, "trace and quality"};
constexpr Shown checked{[](const Metrics& m) { return m.trace && m.accuracy; }, "trace and accuracy"};

/// What a plot shows and the experiment has not; empty: nothing.
std::string_view no_hard_rays(const Experiment& experiment) {
  return has_workload(experiment, [](const std::string& w) { return w.starts_with("hard"); })
             ? ""
             : "workloads of hard rays, as hard_edge";
}
std::string_view no_camera_edges(const Experiment& experiment) {
  return has_workload(experiment, [](const std::string& w) { return w == "camera_edges"; })
             ? ""
             : "the workload camera_edges";
}
std::string_view one_way_off_surfaces(const Experiment& experiment) {
  return has_rays_on_surfaces(experiment) && experiment.rays.self_intersection.size() > 1
             ? ""
             : "several ways of `rays: self_intersection`";
}

struct Plot {
  std::string_view name;
  Shown metrics;
  bool only_when_named = false;  ///< few experiments have something for it to show
  std::string_view (*lack)(const Experiment&) = [](const Experiment&) { return std::string_view(); };
};

constexpr Plot kPlots[] = {
    {"rays_per_second", traced},
    {"rays_by_builder", traced},
    {"sah_cost", of_quality},
    {"epo", of_quality},
    {"leaf_histograms", of_quality},
    {"bytes_per_triangle", traced_or_built},
    {"build_time", built},
    {"build_phases", built},
    {"sah_vs_time", traced_of_quality},
    {"build_vs_trace", traced_and_built},
    {"memory_vs_time", traced},
    {"visits_per_ray", traced},
    {"accuracy_vs_time", checked},
    {"lane_utilization", traced, true},
    {"published_ratios", traced, true},
    {"leaks_vs_distance", checked, false, no_hard_rays},
    {"leaks_vs_aspect", checked, false, no_hard_rays},
    {"leak_picture", checked, false, no_camera_edges},
    {"self_intersection", traced, false, one_way_off_surfaces},  // how rays leave their surface is always checked
    {"traversal_ratios", traced, true},
};
constexpr auto kNames = [] {
  std::array<std::string_view, std::size(kPlots)> names;
  for (std::size_t i = 0; i < names.size(); ++i) names[i] = kPlots[i].name;
  return names;
}();

}  // namespace

std::span<const std::string_view> plot_names() { return kNames; }

std::vector<std::string> default_plots(const Experiment& experiment) {
  std::vector<std::string> plots;
  for (const Plot& plot : kPlots)
    if (plot.metrics.are_measured(experiment.metrics) && plot.lack(experiment).empty() && !plot.only_when_named)
      plots.emplace_back(plot.name);
  return plots;
}

std::vector<std::string> read_plots(const YamlReader& yaml, const YAML::Node& node, const Experiment& experiment) {
  std::vector<std::string> plots;
  if (node.IsSequence() && node.size() == 0) return plots;  // none, said plainly
  for (const YAML::Node& value : yaml.list(node, "plots")) {
    const std::string name = value.Scalar();
    const Plot* plot = std::ranges::find(kPlots, name, &Plot::name);
    if (plot == std::end(kPlots))
      yaml.fail(value, unknown_name_message("plot", name, std::vector<std::string>(kNames.begin(), kNames.end())));
    if (!plot->metrics.are_measured(experiment.metrics))
      yaml.fail(value, fmt::format("plot {} has no data: it takes {} in `metrics`", name, plot->metrics.words));
    if (const std::string_view lack = plot->lack(experiment); !lack.empty() && !experiment.overridden)
      yaml.fail(value, fmt::format("plot {} has no data: it shows {}, and there are none", name, lack));
    plots.push_back(name);
  }
  return plots;
}

}  // namespace arboretum
