// Parts of one plan, measured apart, as one result: what a whole run would have written.
#pragma once

#include <string>
#include <vector>

#include "experiments/result_folder.h"
#include "experiments/runner.h"

namespace arboretum {

struct MergeOptions {
  bool allow_different_machines = false;
  bool allow_different_revisions = false;
};

struct Merged {
  RunOutcome outcome;       ///< cells in the plan's order; warnings
  std::vector<Json> lines;  ///< of cells.jsonl, as the parts have them, with `part` and origins where they are of
                            ///< several machines or revisions
  Plan plan;                ///< `skipped` and the counts; no cells
  PlanRecord record;        ///< of the whole plan
  Json context;
  unsigned shards = 1;                     ///< that the plan was cut into
  std::vector<PlanRecord::Entry> missing;  ///< cells of the plan that no part has, nor skips
};

/// Throws UserError when the parts are not of one configuration; have other geometry under one name; hold a cell twice;
/// or, without the option that allows it, are of different machines or revisions. `command` is the command line as
/// typed.
[[nodiscard]] Merged merge_folders(const std::vector<ResultFolder>& parts, const MergeOptions& options,
                                   const std::string& command);

/// "20 of 96 cells of the plan are in none of the parts: 20 of shard 3/4"; empty where nothing is missing.
[[nodiscard]] std::string missing_line(const Merged& merged);

}  // namespace arboretum
