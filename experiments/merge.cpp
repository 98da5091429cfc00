#include "experiments/merge.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "core/error.h"
#include "experiments/append_file.h"
#include "experiments/plan_record.h"
#include "experiments/results_writer.h"
#include "experiments/scene_data.h"
#include "experiments/shell_words.h"
#include "experiments/summary.h"
#include "experiments/table_text.h"

namespace arboretum {
namespace {

/// A scene without its folder and whether it may be missing, which make no other configuration.
std::string without_folder(std::string line) {
  for (const std::string_view kind : {"- {file: ", "- {scene: "}) {
    if (!line.starts_with(kind)) continue;
    if (const std::size_t slash = line.rfind('/'); slash != std::string::npos)
      line.erase(kind.size(), slash + 1 - kind.size());
    constexpr std::string_view kOptional = ", optional: true";
    if (const std::size_t at = line.find(kOptional); at != std::string::npos) line.erase(at, kOptional.size());
  }
  return line;
}

/// The settings of an effective.yaml: its lines without indentation, comments and empty lines.
std::vector<std::string> setting_lines(const ResultFolder& folder) {
  std::vector<std::string> lines;
  for (const std::string& line : read_lines(folder.path / "effective.yaml")) {
    const std::size_t start = line.find_first_not_of(" \t\r");
    if (start != std::string::npos && line[start] != '#') lines.push_back(without_folder(line.substr(start)));
  }
  return lines;
}

/// The first line by which two effective.yaml differ; empty where they do not, or one is not there.
std::string first_difference(const ResultFolder& a, const ResultFolder& b) {
  const std::vector<std::string> of_a = setting_lines(a), of_b = setting_lines(b);
  if (of_a.empty() || of_b.empty()) return {};
  const auto [in_a, in_b] = std::ranges::mismatch(of_a, of_b);
  if (in_a == of_a.end() && in_b == of_b.end()) return {};
  if (in_a == of_a.end()) return fmt::format("; {} alone has `{}`", b.path.string(), *in_b);
  if (in_b == of_b.end()) return fmt::format("; {} alone has `{}`", a.path.string(), *in_a);
  return fmt::format("; they differ in `{}` against `{}`", *in_a, *in_b);
}

void refuse_different_configurations(const ResultFolder& first, const ResultFolder& part) {
  if (part.configuration_hash == first.configuration_hash) return;
  const auto hash = [](const ResultFolder& f) {
    return f.configuration_hash.empty() ? "unknown" : f.configuration_hash;
  };
  throw UserError(
      fmt::format("{} and {} are of different configurations (hashes {} and {}){}; merge parts of one configuration, "
                  "or `compare` the two",
                  first.path.string(), part.path.string(), hash(first), hash(part), first_difference(first, part)));
}

std::string revision(const ResultFolder& part) {
  return short_revision(part.context) + (part.context.value("git_dirty", false) ? " with changes" : "");
}

/// What machine and build of the part differ by from the first part's, told and refused or allowed.
void check_machine(const ResultFolder& first, const ResultFolder& part, const MergeOptions& options,
                   std::vector<std::string>& warnings) {
  const std::vector<std::string> machine = machine_differences(first.context, part.context);
  if (!machine.empty()) {
    const std::string what = fmt::format("{} and {} were measured on different machines or builds ({})",
                                         first.path.string(), part.path.string(), fmt::join(machine, "; "));
    if (!options.allow_different_machines)
      throw UserError(what + "; their times do not compare; --allow-different-machines merges them all the same");
    warnings.push_back(what + "; compare times only within the same `part`");
  }
  if (revision(first) != revision(part) || first.context_text("git_revision") != part.context_text("git_revision")) {
    const std::string what = fmt::format("{} is of revision {} and {} of {}", first.path.string(), revision(first),
                                         part.path.string(), revision(part));
    if (!options.allow_different_revisions)
      throw UserError(what + "; --allow-different-revisions merges them all the same");
    warnings.push_back(what);
  }
}

/// A part that was gone on with on another machine or at another revision is two parts in one.
void check_begun(const ResultFolder& part, const MergeOptions& options, std::vector<std::string>& warnings) {
  if (part.begun.empty()) return;
  const std::string what = fmt::format("{} was {}", part.path.string(), fmt::join(part.begun, "; "));
  const std::size_t elsewhere = begun_elsewhere(part.begun).size();
  if (elsewhere > 0 && !options.allow_different_machines)
    throw UserError(what + "; its times do not compare; --allow-different-machines merges them all the same");
  if (elsewhere < part.begun.size() && !options.allow_different_revisions)
    throw UserError(what + "; --allow-different-revisions merges them all the same");
  warnings.push_back(what);
}

/// One name, one geometry: a file may have been edited between two parts.
void refuse_different_geometry(const std::vector<ResultFolder>& parts) {
  std::map<std::string, std::pair<const ResultFolder*, std::string>> known;
  for (const ResultFolder& part : parts) {
    if (!part.plan) continue;
    for (const auto& [scene, hash] : part.plan->geometry) {
      const auto& [first, of_first] = known.try_emplace(scene, &part, hash).first->second;
      if (hash == of_first) continue;
      throw UserError(
          fmt::format("{} and {} were measured with different scenes called {} ({}: hashes {} and {}); measure one of "
                      "them anew",
                      first->path.string(), part.path.string(), scene, kHeldByGeometry, of_first, hash));
    }
  }
}

void refuse_doubled_cells(const std::vector<ResultFolder>& parts) {
  std::map<std::string, const ResultFolder*> owners;
  std::size_t doubled = 0;
  std::string first;
  for (const ResultFolder& part : parts) {
    for (const CellResult& cell : part.cells) {
      const auto [owner, fresh] = owners.try_emplace(cell.cell.name(), &part);
      if (fresh) continue;
      if (doubled++ == 0)
        first = fmt::format("{} is in both {} and {}", owner->first, owner->second->path.string(), part.path.string());
    }
  }
  if (doubled > 0)
    throw UserError(fmt::format("{}{}; each cell may be in one part alone: leave one of the folders out", first,
                                doubled > 1 ? fmt::format(", as are {} more", doubled - 1) : ""));
}

/// The command without what made it a part of the whole.
std::string whole_command(const std::string& command) {
  const std::vector<std::string> words = shell_split(command);
  std::vector<std::string> kept;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    if (word == "--shard" || word == "--out") {
      ++i;
    } else if (word != "--resume" && !word.starts_with("--shard=") && !word.starts_with("--out=")) {
      kept.push_back(word);
    }
  }
  return shell_line(kept);
}

Json merged_context(const std::vector<ResultFolder>& parts, const std::string& command) {
  Json context = parts.front().context;
  if (!context.is_object()) context = Json::object();
  for (const char* key : kLaterContextKeys) context.erase(key);
  std::set<std::string> commands;
  Json from = Json::array();
  for (const ResultFolder& part : parts) {
    commands.insert(whole_command(part.context_text("command")));
    Json& entry = from.emplace_back(
        Json{{"part", from.size() + 1}, {"folder", part.path.string()}, {"cells", part.cells.size()}});
    for (const char* key : {"shard", "date", "host_name", "cpu", "git_revision", "command", "merged_from"})
      if (part.context.contains(key)) entry[key] = part.context[key];
  }
  context["command"] = commands.size() == 1 ? *commands.begin() : command;
  // What differs is named with all its values, so that it equals no single machine's.
  for (const char* key : {"host_name", "cpu", "cores", "governor", "isa", "compiler", "compiler_flags", "build_type",
                          "version", "git_revision", "git_dirty"}) {
    std::vector<std::string> values;
    for (const ResultFolder& part : parts)
      if (std::ranges::find(values, part.context_text(key)) == values.end()) values.push_back(part.context_text(key));
    if (values.size() > 1) context[key] = fmt::format("{}", fmt::join(values, " | "));
  }
  context["merged_from"] = std::move(from);
  for (const ResultFolder& part : parts)
    if (const auto scenes = part.context.find("scenes"); scenes != part.context.end() && scenes->is_object())
      context["scenes"].update(*scenes);
  return context;
}

/// In a cell's line too each repetition says where it is from.
void add_origins(Json& line, const CellResult& cell) {
  for (std::size_t i = 0; i < cell.repetitions.size(); ++i)
    add_origin(line["repetitions"][i], cell.repetitions[i].origin);
}

/// The plan of the whole in the making: the union of the parts' plans, and what the parts say of its cells.
class WholePlan {
 public:
  WholePlan(const std::vector<ResultFolder>& parts, Merged& merged) : parts_(parts), merged_(merged) {
    for (const ResultFolder& part : parts)
      if (part.plan) unite(*part.plan);
    for (const ResultFolder& part : parts) take_outcome(part);
  }

  /// In the plan's order: what was measured, and what neither was nor is said to be impossible.
  void place_cells() {
    for (const PlanRecord::Entry& entry : merged_.record.cells) {
      if (const auto found = measured_.find(entry.name); found != measured_.end()) {
        const auto& [part, place] = found->second;
        merged_.outcome.results.push_back(part->cells[place]);
        merged_.lines.push_back(part->lines[place]);
      } else if (!reasons_.contains(entry.name)) {
        merged_.missing.push_back(entry), merged_.outcome.missing.push_back(entry.name);
      }
    }
  }

  /// Skipped cells, the plan's first. What one part skips and another measured is none.
  void place_skipped() {
    for (const PlanRecord::Entry& entry : merged_.record.skipped) {
      const auto found = reasons_.find(entry.name);
      if (found != reasons_.end() || !planned_.contains(entry.name))
        skip(entry.name, found != reasons_.end() ? found->second : entry.reason);
    }
    for (const ResultFolder& part : parts_)
      for (const SkippedCell& cell : part.skipped)
        if (!skippable_.contains(cell.name)) skip(cell.name, cell.reason);
  }

  void count() {
    merged_.plan.excluded = merged_.record.excluded;
    merged_.plan.filtered = merged_.record.filtered = whole_ - std::min(whole_, merged_.record.cells.size());
  }

 private:
  void unite(const PlanRecord& plan) {
    PlanRecord& record = merged_.record;
    whole_ = std::max(whole_, plan.cells.size() + plan.filtered);
    record.excluded = plan.excluded;
    record.geometry.insert(plan.geometry.begin(), plan.geometry.end());
    if (record.cells.empty()) record.filter = plan.filter, record.skip = plan.skip;
    merged_.shards = std::max(merged_.shards, plan.shard.of);
    for (const Json& earlier : plan.earlier)
      if (std::ranges::find(record.earlier, earlier) == record.earlier.end()) record.earlier.push_back(earlier);
    for (const PlanRecord::Entry& entry : plan.cells)
      if (planned_.insert(entry.name).second) record.cells.push_back(entry);
    for (const PlanRecord::Entry& entry : plan.skipped)
      if (skippable_.insert(entry.name).second) record.skipped.push_back(entry);
    if (plan.filter != record.filter || plan.skip != record.skip) record.filter.clear(), record.skip.clear();
  }

  void take_outcome(const ResultFolder& part) {
    for (std::size_t i = 0; i < part.cells.size(); ++i) {
      const std::string name = part.cells[i].cell.name();
      measured_.emplace(name, std::pair{&part, i});
      if (planned_.insert(name).second) merged_.record.cells.push_back({name, 1, ""});
    }
    for (const SkippedCell& cell : part.skipped) reasons_.emplace(cell.name, cell.reason);
  }

  void skip(const std::string& name, const std::string& reason) {
    if (!measured_.contains(name)) merged_.plan.skipped.push_back({name, reason});
  }

  const std::vector<ResultFolder>& parts_;
  Merged& merged_;
  std::set<std::string> planned_, skippable_;  // names of merged_.record's cells and skipped cells
  std::map<std::string, std::pair<const ResultFolder*, std::size_t>> measured_;
  std::map<std::string, std::string> reasons_;  // of the cells that some part skipped
  std::size_t whole_ = 0;                       // cells of the plan before a filter
};

}  // namespace

Merged merge_folders(const std::vector<ResultFolder>& parts, const MergeOptions& options, const std::string& command) {
  Merged merged;
  for (const ResultFolder& part : parts) {
    if (part.lines.size() != part.cells.size())
      throw UserError(
          fmt::format("{}: has no cells.jsonl, which holds what merge joins; give the folder that `run` wrote",
                      part.path.string()));
    if (&part != &parts.front()) {
      refuse_different_configurations(parts.front(), part);
      check_machine(parts.front(), part, options, merged.outcome.warnings);
    }
    check_begun(part, options, merged.outcome.warnings);
  }
  const bool one_machine = merged.outcome.warnings.empty();
  refuse_different_geometry(parts);
  refuse_doubled_cells(parts);
  WholePlan whole(parts, merged);
  whole.place_cells(), whole.place_skipped(), whole.count();
  merged.context = merged_context(parts, command);
  merged.record.context = merged.context;
  if (!one_machine) {  // each row then knows whose it is
    std::map<std::string, std::size_t> owners;
    for (std::size_t i = 0; i < parts.size(); ++i)
      for (const CellResult& cell : parts[i].cells) owners.emplace(cell.cell.name(), i + 1);
    for (std::size_t i = 0; i < merged.lines.size(); ++i) {
      const std::size_t part = owners.at(merged.outcome.results[i].cell.name());
      merged.outcome.results[i].facts["part"] = part, merged.lines[i]["part"] = part;
      add_origins(merged.lines[i], merged.outcome.results[i]);
    }
  }
  Plan measured{
      .cells = {}, .skipped = merged.plan.skipped, .excluded = 0, .filtered = 0, .in_other_shards = 0, .elsewhere = {}};
  for (const CellResult& result : merged.outcome.results) measured.cells.push_back(result.cell);
  const Json cores = parts.front().context.value("cores", Json());
  const std::vector<std::string> usual =
      run_warnings(merged.outcome, measured, cores.is_number() ? cores.get<unsigned>() : ~0u);
  merged.outcome.warnings.insert(merged.outcome.warnings.end(), usual.begin(), usual.end());
  const std::vector<std::string> dropped = dropped_warnings(merged.context.value("scenes", Json::object()));
  merged.outcome.warnings.insert(merged.outcome.warnings.end(), dropped.begin(), dropped.end());
  return merged;
}

std::string missing_line(const Merged& merged) {
  if (merged.missing.empty()) return {};
  std::map<unsigned, std::size_t> counts;
  for (const PlanRecord::Entry& entry : merged.missing) ++counts[entry.shard];
  std::vector<std::string> shards;
  for (const auto& [index, count] : counts)
    shards.push_back(fmt::format("{} of shard {}/{}", count, index, merged.shards));
  const std::string where = merged.shards > 1 ? fmt::format(": {}", fmt::join(shards, ", ")) : "";
  return fmt::format("{} of {} of the plan {} in none of the parts{}", merged.missing.size(),
                     counted(merged.record.cells.size(), "cell"), merged.missing.size() == 1 ? "is" : "are", where);
}

}  // namespace arboretum
