// Plan: the cells of an experiment, and those that cannot be, each with its reason.
#pragma once

#include <string>
#include <vector>

#include "experiments/cell.h"
#include "experiments/config.h"

namespace arboretum {

struct Plan {
  std::vector<Cell> cells;  ///< scene by scene; a scene's build cells come first
  std::vector<SkippedCell> skipped;
  std::size_t excluded = 0;         ///< by the configuration's `exclude`
  std::size_t filtered = 0;         ///< by --filter and --skip
  std::size_t in_other_shards = 0;  ///< by --shard
  /// Cells of `include` that `exclude` takes away, a line for each: name, and which entries.
  std::vector<std::string> excluded_includes = {};
  /// Cells that a machine with more instruction sets, or with the optional scenes, would measure. Those of them that
  /// trace are among `skipped`; the builds, too, where nothing is traced.
  std::vector<Cell> elsewhere;
};

/// The product of the axes, with `include`, without `exclude`. A combination that has no kernel, or whose ISA
/// the machine lacks, is skipped with its reason; where nothing is traced, the build that it would take. A parameter
/// multiplies and names the cells whose builder, or way of traversal, reads it, and no others. Throws UserError for an
/// include that adds nothing, an exclude that takes nothing away, and a parameter that no cell reads.
[[nodiscard]] Plan make_plan(const Experiment& experiment, const Registry& registry);

/// Keeps the cells (those of `elsewhere` and the skipped ones too) whose names a NameFilter takes. Throws UserError for
/// a broken expression.
void apply_filter(Plan& plan, const std::string& filter, const std::string& skip);

/// Skipped cells by reason, most first.
[[nodiscard]] std::vector<std::pair<std::string, std::size_t>> group_reasons(const std::vector<SkippedCell>& skipped);

}  // namespace arboretum
