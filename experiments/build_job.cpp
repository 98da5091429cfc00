#include "experiments/build_job.h"

#include <algorithm>

#include "experiments/passes.h"
#include "experiments/warm_up.h"

namespace arboretum {

void BuildJob::prepare(Json& facts, StructurePool& pool, const MeasureSettings& measure) {
  BuildReport report;
  const auto accel = registry_.build(cell_.structure, mesh_, settings_of(cell_), report);
  facts.update(pool.facts(cell_, *accel));
  facts["peak_build_bytes"] = report.peak_bytes;
  const auto build = [&] {
    BuildReport again;
    static_cast<void>(registry_.build(cell_.structure, mesh_, settings_of(cell_), again));
    return again.seconds;
  };
  warm_up(0, measure.min_warmup_time, build);
  // The first build finds memory cold, but not so cold that this would not tell.
  constexpr double kLong = 4.0;
  const double enough = std::min(kEnoughOfBuilds, measure.min_time);
  if (report.seconds < kLong * enough) builds_ = passes_lasting(enough, kMostBuilds, build);
}

Repetition BuildJob::measure(TimedLoop& loop) const {
  Repetition repetition;
  while (loop.next()) {
    BuildReport report;
    const auto accel = registry_.build(cell_.structure, mesh_, settings_of(cell_), report);
    repetition.wall_seconds += report.seconds;
    repetition.cpu_seconds += report.cpu_seconds;
    for (const auto& [name, seconds] : report.phases) {
      const auto known = std::ranges::find(repetition.phases, name, &std::pair<std::string, double>::first);
      if (known == repetition.phases.end())
        repetition.phases.emplace_back(name, seconds);
      else
        known->second += seconds;
    }
    if (accel->info().can_refit) repetition.refit_seconds += refit_structure(*accel, mesh_, cell_.threads);
  }
  return repetition;
}

}  // namespace arboretum
