#include "experiments/config_plots.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/names.h"

namespace arboretum {
namespace {

constexpr std::string_view kPlots[] = {
    "rays_per_second",  "rays_by_builder",    "sah_cost",          "epo",
    "leaf_histograms",  "bytes_per_triangle", "build_time",        "build_phases",
    "sah_vs_time",      "build_vs_trace",     "memory_vs_time",    "visits_per_ray",
    "accuracy_vs_time", "lane_utilization",   "published_ratios",  "leaks_vs_distance",
    "leaks_vs_aspect",  "leak_picture",       "self_intersection", "traversal_ratios"};
/// Drawn only where a configuration names them: few experiments have something for them to show.
constexpr std::string_view kOnlyWhenNamed[] = {"lane_utilization", "published_ratios", "traversal_ratios"};

bool is_measured(std::string_view plot, const Metrics& m) {
  if (plot == "rays_per_second" || plot == "rays_by_builder" || plot == "lane_utilization" ||
      plot == "memory_vs_time" || plot == "visits_per_ray" || plot == "published_ratios" ||
      plot == "traversal_ratios" || plot == "self_intersection")  // how rays leave their surface is always checked
    return m.trace;
  if (plot == "build_time" || plot == "build_phases") return m.build;
  if (plot == "sah_cost" || plot == "epo" || plot == "leaf_histograms") return m.quality;
  if (plot == "bytes_per_triangle") return m.trace || m.build;
  if (plot == "sah_vs_time") return m.quality && m.trace;
  if (plot == "build_vs_trace") return m.build && m.trace;
  return m.accuracy && m.trace;
}

template <class Predicate>
bool has_workload(const Experiment& experiment, const Predicate& wanted) {
  const auto has = [&](const AxisLists& axes) { return std::ranges::any_of(axes[index_of(Axis::workload)], wanted); };
  return has(experiment.axes) ||
         std::ranges::any_of(experiment.include, [&](const CellChoice& c) { return has(c.axes); });
}

/// What a plot needs and the experiment has not, its metrics apart; empty: nothing.
std::string what_lacks(std::string_view plot, const Experiment& experiment) {
  if ((plot == "leaks_vs_distance" || plot == "leaks_vs_aspect") &&
      !has_workload(experiment, [](const std::string& w) { return w.starts_with("hard"); }))
    return "it shows workloads of hard rays, as hard_edge";
  if (plot == "leak_picture" && !has_workload(experiment, [](const std::string& w) { return w == "camera_edges"; }))
    return "it shows the workload camera_edges";
  if (plot == "self_intersection" &&
      !(has_rays_on_surfaces(experiment) && experiment.rays.self_intersection.size() > 1))
    return "it shows several ways of `rays: self_intersection`";
  return {};
}

}  // namespace

std::span<const std::string_view> plot_names() { return kPlots; }

std::vector<std::string> default_plots(const Experiment& experiment) {
  std::vector<std::string> plots;
  for (std::string_view plot : kPlots)
    if (is_measured(plot, experiment.metrics) && what_lacks(plot, experiment).empty() &&
        std::ranges::find(kOnlyWhenNamed, plot) == std::end(kOnlyWhenNamed))
      plots.emplace_back(plot);
  return plots;
}

std::vector<std::string> read_plots(const YamlReader& yaml, const YAML::Node& node, const Experiment& experiment) {
  std::vector<std::string> plots;
  if (node.IsSequence() && node.size() == 0) return plots;  // none, said plainly
  const std::vector<std::string> known(std::begin(kPlots), std::end(kPlots));
  for (const YAML::Node& value : yaml.list(node, "plots")) {
    const std::string name = value.Scalar();
    if (std::ranges::find(known, name) == known.end()) yaml.fail(value, unknown_name_message("plot", name, known));
    if (!is_measured(name, experiment.metrics))
      yaml.fail(value, fmt::format("plot {} has no data: a metric that it shows is not in metrics", name));
    if (const std::string lack = what_lacks(name, experiment); !lack.empty() && !experiment.overridden)
      yaml.fail(value, fmt::format("plot {} has no data: {}, and there are none", name, lack));
    plots.push_back(name);
  }
  return plots;
}

}  // namespace arboretum
