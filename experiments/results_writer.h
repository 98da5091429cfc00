// results.json, readable by Google Benchmark's compare.py, and results.csv, one row a repetition.
#pragma once

#include <filesystem>
#include <string>

#include "experiments/runner.h"

namespace arboretum {

/// What a copy of the results leaves out, and the unit of its `real_time` and `cpu_time`.
struct ResultForm {
  bool aggregates_only = false;
  std::string time_unit = "ms";  ///< ns, us, ms or s
};

/// What the context is given after the machine's: the shard, and by results_json() what the run came to.
inline constexpr const char* kLaterContextKeys[] = {"shard",          "scenes",         "cells",
                                                    "excluded_cells", "filtered_cells", "skipped_cells",
                                                    "missing_cells",  "warnings",       "merged_from"};

/// `context`, `benchmarks` (every cell's repetitions, then its aggregates) `skipped` (name and reason)
/// and, of a merge that lacks some, `missing`. Where repetitions are of several machines or revisions, each says which:
/// `cpu`, `git_revision`.
[[nodiscard]] std::string results_json(const RunOutcome& outcome, const Plan& plan, Json context,
                                       const ResultForm& form = {});
/// One row a repetition (or aggregate, where `form` says so); empty where a figure does not apply.
[[nodiscard]] std::string results_csv(const RunOutcome& outcome, const ResultForm& form = {});

/// A value as people read it: strings without their quotes.
[[nodiscard]] std::string plain_text(const Json& value);
/// A value of a CSV row, quoted where need be.
[[nodiscard]] std::string csv_field(const Json& value);

}  // namespace arboretum
