// A result folder as it is read back: the cells that it holds, the machine that they were measured on, what was
// skipped. Also of a run that was cut off, of a merged one, and of one of which results.json alone is left.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "experiments/plan_record.h"
#include "experiments/result.h"

namespace arboretum {

struct ResultFolder {
  std::filesystem::path path;
  Json context = Json::object();
  std::string configuration_hash;    ///< empty where nothing in the folder says it
  std::vector<CellResult> cells;     ///< in the plan's order, each name once
  std::vector<Json> lines;           ///< of cells.jsonl, one for each of `cells`; empty where there is no such file
  std::vector<SkippedCell> skipped;  ///< with reasons, also those that turned out impossible while running
  std::optional<PlanRecord> plan;    ///< std::nullopt: of an older revision
  bool complete = false;             ///< the run went through: results.json is there
  /// Of a run that was begun under other conditions than those of `context`, and gone on with: how they differ, as
  /// differing_conditions() has it.
  std::vector<std::string> begun;

  [[nodiscard]] std::string context_text(const char* key) const;
};

/// Throws UserError, naming the nearest folder that is one, when `path` is no result folder or cannot be read.
[[nodiscard]] ResultFolder read_result_folder(const std::filesystem::path& path);

/// What the first lines of a folder's effective.yaml begin with; the second only of a shard.
inline constexpr const char *kConfigurationHashHead = "# configuration hash: ", *kShardHead = "# shard: ";
/// Of a folder's effective.yaml; empty where there is none, or it does not say.
[[nodiscard]] std::string hash_of_configuration(const std::filesystem::path& folder);

/// The cell that an entry of a result file is of, as far as its fields tell; `kernel` and parameters are left out.
/// Throws nlohmann::json::exception where a field is missing.
[[nodiscard]] Cell cell_of(const Json& entry);

/// "CPU: AMD EPYC against Intel Xeon" for each thing of machine and build by which two contexts differ, and which makes
/// their times incomparable: CPU, cores, governor, instruction sets, compiler and its flags.
[[nodiscard]] std::vector<std::string> machine_differences(const Json& a, const Json& b);

/// How two runs differ that should be one: kBegunElsewhere and a difference of machine or build, "begun at revision …,
/// gone on with at …"; empty where their results compare with each other.
[[nodiscard]] std::vector<std::string> differing_conditions(const Json& before, const Json& now);
inline constexpr const char* kBegunElsewhere = "begun under other conditions: ";

/// Those of `begun` that are of another machine or build, without kBegunElsewhere.
[[nodiscard]] std::vector<std::string> begun_elsewhere(const std::vector<std::string>& begun);

/// The first digits of a context's revision; of a merge, of each of them.
[[nodiscard]] std::string short_revision(const Json& context);

/// The machine and revision of a context; empty where it is of several.
[[nodiscard]] Origin origin_of(const Json& context);

}  // namespace arboretum
