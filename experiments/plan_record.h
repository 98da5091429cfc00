// plan.json: what a run set out to do, written before it measures: the cells of the plan with the shard that each is
// in, the skipped ones with their reasons, and the machine. `merge` tells by it what is missing, `compare` where a run
// that was cut off ran.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "experiments/plan.h"
#include "experiments/result.h"
#include "experiments/shard.h"

namespace arboretum {

struct PlanRecord {
  struct Entry {
    std::string name;
    unsigned shard = 1;
    std::string reason;  ///< of a skipped cell
  };
  Shard shard;               ///< the one that was run
  std::string filter, skip;  ///< --filter and --skip
  std::size_t excluded = 0, filtered = 0;
  std::vector<Entry> cells, skipped;  ///< of all shards, in the plan's order
  Json context = Json::object();
  /// Hashes of the scenes that were read from files or placed, by name: SceneData::geometry(). Of others the
  /// configuration says all. Empty: of an older revision.
  std::map<std::string, std::string> geometry = {};
  std::vector<Json> earlier = {};  ///< contexts of the runs that this one goes on with, the oldest first
};

inline constexpr const char* kPlanFile = "plan.json";
/// What a scene's hash in PlanRecord::geometry tells apart, in words.
inline constexpr const char* kHeldByGeometry = "geometry, camera, shutter, lights, materials or images";

/// `plan` is whole: not yet one shard alone.
[[nodiscard]] PlanRecord record_of(const Plan& plan, const std::map<std::string, unsigned>& shards, const Shard& shard);

/// Takes up what a run that is gone on with has measured already and this one, by its filter or on its machine, would
/// not: cells of `whole`, the plan before the filter, among them those of `elsewhere`. They keep their places in the
/// plan's order.
void keep_measured(Plan& plan, PlanRecord& record, const Plan& whole, const std::map<std::string, CellResult>& done);

[[nodiscard]] std::string to_text(const PlanRecord& record);
/// The folder's; std::nullopt where it has none. Throws UserError when it cannot be understood.
[[nodiscard]] std::optional<PlanRecord> read_plan_record(const std::filesystem::path& folder);

}  // namespace arboretum
