// results.json, readable by Google Benchmark's compare.py, and results.csv, one row a repetition.
#pragma once

#include <filesystem>
#include <string>

#include "experiments/runner.h"

namespace arboretum {

/// `context`, `benchmarks` (every cell's repetitions, then its aggregates) `skipped` (name and reason)
/// and, of a merge that lacks some, `missing`.
[[nodiscard]] std::string results_json(const RunOutcome& outcome, const Plan& plan, Json context);
/// One row a repetition; empty where a figure does not apply.
[[nodiscard]] std::string results_csv(const RunOutcome& outcome);

/// A value as people read it: strings without their quotes.
[[nodiscard]] std::string plain_text(const Json& value);
/// A value of a CSV row, quoted where need be.
[[nodiscard]] std::string csv_field(const Json& value);

}  // namespace arboretum
