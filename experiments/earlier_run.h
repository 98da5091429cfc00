// What the folder of a run that is gone on with says of that run: whether this one may go on with it, and what of it
// has to be said on.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "experiments/config.h"
#include "experiments/plan_record.h"
#include "experiments/result.h"
#include "experiments/shard.h"

namespace arboretum {

class EarlierRun {
 public:
  /// None: all below then does nothing.
  EarlierRun() = default;
  /// Of a folder; none where it has no plan.
  explicit EarlierRun(const std::filesystem::path& folder) : folder_(folder), record_(read_plan_record(folder)) {}

  /// A shard's folder takes no other shard: its results.json would lose what is there. The whole plan may go on from a
  /// shard. Throws UserError.
  void refuse_other_shard(const Shard& shard) const;
  /// What was measured of a scene stays beside what will be: both must be of the same triangles, or UserError. Takes up
  /// what the folder says of scenes that are not measured now. Folders of older revisions say nothing.
  void refuse_other_geometry(const Experiment& experiment, std::map<std::string, std::string>& geometry) const;
  /// Adds what the folder says of scenes that are not loaded now.
  void take_up_scenes(Json& scenes) const;
  /// The contexts of those who measured before, one for each of their conditions that are not those of now.
  [[nodiscard]] std::vector<Json> other_contexts(const Json& now) const;
  /// The parts that were merged; null where none were.
  [[nodiscard]] Json merged_from() const;
  /// Of repetitions that do not say who measured them, which are of older revisions: the one machine and revision that
  /// the folder is from; none where there were several.
  [[nodiscard]] Origin origin() const;

 private:
  std::filesystem::path folder_;
  std::optional<PlanRecord> record_;
};

}  // namespace arboretum
