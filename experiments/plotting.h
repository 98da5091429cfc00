// Runs plots/plot.py and plots/ratios.py with an interpreter that has matplotlib.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace arboretum {

/// /usr/bin/python3 or the python3 of the PATH, whichever has matplotlib and numpy; ARBORETUM_PYTHON goes
/// before both.
[[nodiscard]] std::optional<std::string> find_plot_python();
/// Draws `figures` (empty: all) and the report of a result folder. Returns one line that says why not, or
/// empty.
[[nodiscard]] std::string draw_plots(const std::filesystem::path& results,
                                     const std::vector<std::string>& figures, bool quiet);

/// Draws the figure of a comparison, given as JSON, to `file`. Returns one line that says why not, or empty.
[[nodiscard]] std::string draw_ratios(const std::string& comparison_json, const std::filesystem::path& file);

}  // namespace arboretum
