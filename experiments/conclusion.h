// The end of a run or a merge: what is said on the terminal, the figures and the report.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/error.h"
#include "experiments/runner.h"

namespace arboretum {

void print_warnings(const std::vector<std::string>& warnings);

/// The configuration's figures, and the report, without a word on stdout. A warning where some cannot be drawn.
void draw_figures(const std::filesystem::path& folder);

/// Warnings, tables, skipped cells, where the report is, and what the exit status says. With
/// `draw` also draw_figures(); the report is there without any figure too.
[[nodiscard]] ExitStatus conclude(const std::filesystem::path& folder, const RunOutcome& outcome, const Plan& plan,
                                  bool draw);

}  // namespace arboretum
