// Runner: measures the cells of a plan, scene by scene, and keeps the journal.
#pragma once

#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "experiments/journal.h"
#include "experiments/plan.h"
#include "experiments/result.h"
#include "experiments/scene_data.h"

namespace arboretum {

struct RunOptions {
  bool fail_fast = false;                            ///< stop after the first cell with a wrong answer
  std::map<std::string, std::string> geometry = {};  ///< of scenes as the run began: PlanRecord::geometry
  Origin origin = {};                                ///< of what is measured now
  std::set<std::string, std::less<>> crashed = {};   ///< what was under way in crashes before: left out
};

struct RunOutcome {
  std::vector<CellResult> results;        ///< in the plan's order; those that were measured
  std::vector<SkippedCell> failed;        ///< cells that turned out impossible while running, each with its reason
  std::vector<std::string> missing = {};  ///< of a merge: cells of the plan that none of the parts holds
  std::vector<std::string> warnings;
  Json scenes = Json::object();  ///< SceneData::load_report() of each that was loaded, by name
  std::string error;             ///< what ended the run early; empty when it went through
  bool stopped = false;          ///< by fail_fast
};

/// Cells of one scene and workload whose structures fit the memory together are interleaved. Takes up what
/// the journal holds. A UserError on the way (a scene that does not load, a full disk) ends the run and is
/// told in the outcome, so that what was measured can still be written. `loaded` is not loaded again.
[[nodiscard]] RunOutcome run_plan(const Experiment& experiment, const Plan& plan, const Registry& registry,
                                  Journal& journal, const RunOptions& options, LoadedScene loaded = {});

}  // namespace arboretum
