#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <system_error>

#include "core/whole_file.h"
#include "experiments/append_file.h"
#include "experiments/commands.h"
#include "experiments/conclusion.h"
#include "experiments/folder_lock.h"
#include "experiments/json_text.h"
#include "experiments/plotting.h"
#include "experiments/results_writer.h"
#include "experiments/shell_words.h"
#include "experiments/table_text.h"

namespace arboretum {
namespace {

namespace fs = std::filesystem;

void refuse_results_there(const fs::path& out) {
  for (const char* file : {"cells.jsonl", "results.json"})
    if (fs::exists(out / file))
      throw UserError(
          fmt::format("{}: already holds results ({}); choose another folder, or remove it", out.string(), file));
}

std::vector<ResultFolder> read_parts(const std::vector<fs::path>& paths) {
  std::vector<ResultFolder> parts;
  std::error_code ignored;
  for (std::size_t i = 0; i < paths.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j)
      if (fs::equivalent(paths[i], paths[j], ignored))
        throw UserError(fmt::format("{}: given twice; each part counts once", paths[i].string()));
    parts.push_back(read_result_folder(paths[i]));
  }
  return parts;
}

/// What stands beside the results: the effective configuration without the shard, repetitions of cells that have not
/// ended, points of pictures.
void write_beside(const fs::path& out, const std::vector<ResultFolder>& parts, const Merged& merged) {
  std::string repetitions;
  for (const ResultFolder& part : parts)
    for (const std::string& line : read_lines(part.path / "repetitions.jsonl")) repetitions += line + "\n";
  if (!repetitions.empty()) write_whole(out / "repetitions.jsonl", repetitions);
  write_whole(out / kPlanFile, to_text(merged.record));
  std::string effective;
  for (std::size_t i = 0; i < parts.size() && effective.empty(); ++i)
    for (const std::string& line : read_lines(parts[i].path / "effective.yaml"))
      if (!line.starts_with(kShardHead)) effective += line + "\n";
  if (!effective.empty()) write_whole(out / "effective.yaml", effective);
  for (const ResultFolder& part : parts) {
    for (const fs::directory_entry& entry : fs::directory_iterator(part.path)) {
      const std::string name = entry.path().filename().string();
      if (is_seen_points_file(name)) write_whole(out / name, read_whole(entry.path()));
    }
  }
}

void print_missing(const MergeCommand& command, const Merged& merged) {
  if (merged.missing.empty()) return;
  fmt::print("\nmissing:\n");
  for (std::size_t i = 0; i < std::min(merged.missing.size(), kMostNamed); ++i)
    fmt::print("  {}\n", merged.missing[i].name);
  if (merged.missing.size() > kMostNamed)
    fmt::print("  and {} more: `missing` in results.json\n", merged.missing.size() - kMostNamed);
  const auto option = [](const char* name, const std::string& value) {
    return value.empty() ? "" : fmt::format(" {} {}", name, shell_word(value));
  };
  fmt::print("to measure them: arboretum run {} --resume --out {}{}{}\n",
             shell_word((command.out / "effective.yaml").string()), shell_word(command.out.string()),
             option("--filter", merged.record.filter), option("--skip", merged.record.skip));
}

}  // namespace

ExitStatus command_merge(const MergeCommand& command) {
  refuse_results_there(command.out);
  const std::vector<ResultFolder> parts = read_parts(command.parts);
  Merged merged = merge_folders(parts, command.options, command.command_line);
  if (const std::string missing = missing_line(merged); !missing.empty()) {
    if (command.require_all)
      throw UserError(missing + "; give the folders that hold them too, or leave out --require-all");
    merged.outcome.warnings.insert(merged.outcome.warnings.begin(), missing);
  }
  if (!command.no_plots) require_chosen_python();
  make_output_folder(command.out);
  const FolderLock lock(command.out, "give another OUT");
  refuse_results_there(command.out);
  write_beside(command.out, parts, merged);
  std::string cells;
  for (const Json& line : merged.lines) cells += to_text(line) + "\n";
  write_whole(command.out / "results.csv", results_csv(merged.outcome));
  write_whole(command.out / "results.json", results_json(merged.outcome, merged.plan, merged.context));
  write_whole(command.out / "cells.jsonl", cells);
  const ExitStatus status = conclude(command.out, merged.outcome, merged.plan, !command.no_plots);
  print_missing(command, merged);
  return status;
}

}  // namespace arboretum
