#include "experiments/build_job.h"

#include <algorithm>
#include <cmath>

#include "experiments/warm_up.h"

namespace arboretum {

void BuildJob::prepare(Json& facts, StructurePool& pool, const MeasureSettings& measure) {
  // A build is long beside the clock's grain; one that takes less than this is repeated within the
  // repetition.
  constexpr double kEnoughSeconds = 0.02;
  constexpr double kMostBuilds = 10'000;
  BuildReport report;
  const auto accel = registry_.build(cell_.structure, mesh_, settings_of(cell_), report);
  facts.update(pool.facts(cell_, *accel));
  facts["peak_build_bytes"] = report.peak_bytes;
  warm_up(0, measure.min_warmup_time, [&] {
    BuildReport again;
    static_cast<void>(registry_.build(cell_.structure, mesh_, settings_of(cell_), again));
  });
  const double enough = std::min(kEnoughSeconds, measure.min_time);
  builds_ =
      static_cast<std::uint64_t>(std::clamp(std::ceil(enough / std::max(report.seconds, 1e-9)), 1.0, kMostBuilds));
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
