// The `plots:` list of a configuration: what the experiment measures must be something for each to show.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "experiments/config.h"
#include "experiments/yaml_reader.h"

namespace arboretum {

/// Plots that plots/plot.py draws.
[[nodiscard]] std::span<const std::string_view> plot_names();

/// Of an experiment that names none: all that have something to show, but for those that few experiments are made for.
/// Its sweep and metrics are complete.
[[nodiscard]] std::vector<std::string> default_plots(const Experiment& experiment);

/// Those that the experiment names; none for `[]`. Its sweep and metrics are complete. Throws UserError for a plot that
/// has nothing to show.
[[nodiscard]] std::vector<std::string> read_plots(const YamlReader& yaml, const YAML::Node& node,
                                                  const Experiment& experiment);

}  // namespace arboretum
