// A comparison as a person reads it.
#pragma once

#include <string>

#include "core/error.h"
#include "experiments/comparison.h"
#include "experiments/result_folder.h"

namespace arboretum {

/// Where A and B come from, and by what of configuration (`settings` by name) or machine they differ.
[[nodiscard]] std::string origins_text(const ResultFolder& a, const ResultFolder& b,
                                       const std::vector<SettingDifference>& settings = {});
/// Tables of cells, means, wrong answers and structures. Many indistinguishable cells are left out unless `all`.
[[nodiscard]] std::string comparison_text(const Comparison& comparison, bool all);
/// kDone, kRegression or kNothingMeasured, and one line that says why.
[[nodiscard]] std::pair<ExitStatus, std::string> verdict(const Comparison& comparison);

}  // namespace arboretum
