// Shards: a plan cut into N parts that run apart (another process, machine, day) and together are exactly the plan.
//
// The names of all cells, in the order of the structures that they use, are cut into N stretches of about equal
// estimated time: so a shard needs few scenes, and a structure is built in one shard, or in two where it lies across a
// cut. Cells that this machine skips for want of an instruction set or a scene weigh as on a machine that has it, and
// so the split is the same everywhere.
#pragma once

#include <map>
#include <string>

#include "experiments/config.h"
#include "experiments/plan.h"

namespace arboretum {

struct Shard {
  unsigned index = 1;  ///< 1 to `of`
  unsigned of = 1;     ///< 1: the whole plan
  [[nodiscard]] bool is_whole() const noexcept { return of == 1; }
  /// "2/8"
  [[nodiscard]] std::string text() const;
  bool operator==(const Shard&) const = default;
};

/// Reads "2/8". Throws UserError for anything else.
[[nodiscard]] Shard parse_shard(const std::string& text);

/// The shard (1 to `of`) of every cell of the plan and every skipped one, by name.
[[nodiscard]] std::map<std::string, unsigned> split_plan(const Experiment& experiment, const Plan& plan, unsigned of);

/// Leaves the cells and skipped cells of one shard; counts the others in `Plan::in_other_shards`.
void keep_shard(Plan& plan, const std::map<std::string, unsigned>& shards, unsigned index);

}  // namespace arboretum
