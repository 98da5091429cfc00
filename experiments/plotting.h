// Runs plots/plot.py and plots/ratios.py with an interpreter that has matplotlib.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace arboretum {

/// ARBORETUM_PYTHON where it is set, and no other; else /usr/bin/python3 or the python3 of the PATH, whichever has
/// matplotlib and numpy.
[[nodiscard]] std::optional<std::string> find_plot_python();
/// Throws UserError where ARBORETUM_PYTHON names what cannot draw: said before hours of measuring, not after.
void require_chosen_python();
/// Draws `figures` (empty: all) and the report of a result folder. Returns one line that says why not, or
/// empty.
[[nodiscard]] std::string draw_plots(const std::filesystem::path& results, const std::vector<std::string>& figures,
                                     bool quiet);

/// Draws the figure of a comparison, given as JSON, to `file`. Returns one line that says why not, or empty.
[[nodiscard]] std::string draw_ratios(const std::string& comparison_json, const std::filesystem::path& file);

}  // namespace arboretum
