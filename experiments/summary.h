// The table at the end of a run, its warnings, and the exit status.
#pragma once

#include <string>
#include <vector>

#include "core/error.h"
#include "experiments/runner.h"

namespace arboretum {

/// A table for each scene and workload: Mray/s, by one clock for all (allows_cpu_time()), with its interval, the ratio
/// to embree, wrong answers, SAH, build time. A build-only run gets a table of builds.
[[nodiscard]] std::string result_tables(const RunOutcome& outcome);
/// "12 cells skipped:" with one line a reason; empty when there is none.
[[nodiscard]] std::string skipped_lines(const Plan& plan, const RunOutcome& outcome);
/// One line each: cells whose repetitions spread widely, scenes that no primary ray hits, more threads than the
/// machine's cores, ISAs that are not there.
[[nodiscard]] std::vector<std::string> run_warnings(const RunOutcome& outcome, const Plan& plan, unsigned cores);
/// kDone, kWrongAnswers or kNothingMeasured, and one line that says why.
[[nodiscard]] std::pair<ExitStatus, std::string> verdict(const RunOutcome& outcome);

}  // namespace arboretum
