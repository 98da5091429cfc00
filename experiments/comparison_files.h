// A comparison for programs: JSON with all that is known, CSV with one row a cell.
#pragma once

#include <string>

#include "experiments/comparison.h"
#include "experiments/result_folder.h"

namespace arboretum {

[[nodiscard]] std::string comparison_json(const Comparison& comparison, const ResultFolder& a, const ResultFolder& b);
[[nodiscard]] std::string comparison_csv(const Comparison& comparison);

}  // namespace arboretum
