// CellResult: what was measured of a cell, and how it reads as JSON.
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "experiments/cell.h"
#include "oracle/start_check.h"
#include "structures/accel.h"
#include "structures/statistics.h"
#include "traversal/kernel_table.h"

namespace arboretum {

using Json = nlohmann::ordered_json;

/// The machine and the revision that measured something; empty where a run of an older revision did not say.
struct Origin {
  std::string cpu, git_revision;
  [[nodiscard]] bool empty() const noexcept { return cpu.empty() && git_revision.empty(); }
  friend auto operator<=>(const Origin&, const Origin&) = default;
};
/// As `cpu` and `git_revision` of a JSON object: none where it is empty, empty where they are none.
void add_origin(Json& json, const Origin& origin);
[[nodiscard]] Origin read_origin(const Json& json);

/// One timed repetition: `iterations` passes over all rays, or that many builds.
struct Repetition {
  unsigned index = 0;
  std::uint64_t iterations = 0;
  double wall_seconds = 0.0;  ///< of all iterations
  double cpu_seconds = 0.0;   ///< of the thread; of the process where the cell has several threads
  std::vector<std::pair<std::string, double>> phases;  ///< of builds: wall seconds of all iterations
  double refit_seconds = 0.0;  ///< of builds: wall seconds of all iterations; 0 where the structure has no refit
  Origin origin = {};
};

struct CellResult {
  Cell cell;
  std::vector<Repetition> repetitions;  ///< by index
  /// What does not change between repetitions, under the names of docs/results.md: `rays`, `sah_cost`,
  /// `wrong_answers`, ...
  Json facts = Json::object();

  [[nodiscard]] bool is_trace() const noexcept { return cell.metric == Cell::Metric::trace; }
  /// Of each repetition: rays (trace) or triangles (build) a second of wall time, or of CPU time.
  [[nodiscard]] std::vector<double> rates(bool cpu) const;
  /// A number among the facts, or `otherwise`.
  [[nodiscard]] double fact(const char* name, double otherwise = 0.0) const;
  /// How many rays the cell's wrong answers are of: of renderers not those that were timed.
  [[nodiscard]] double checked_rays() const { return fact("checked_rays", fact("rays")); }
  [[nodiscard]] bool has_fact(const char* name) const { return facts.contains(name); }
};

/// Repetitions that do not say where they are from are of `origin`.
void name_origins(std::vector<CellResult>& results, const Origin& origin);

void add_facts(Json& facts, const StructureStatistics& statistics);
/// `counters` of the counting pass over `rays` rays of a cell; those that were traced more than once (`exclusion`)
/// count as often.
void add_facts(Json& facts, const Counters& counters, std::size_t rays, std::string_view traversal);
void add_facts(Json& facts, const AnswerCheck& check, bool closest_hit);
void add_facts(Json& facts, const StartCheck& check, bool closest_hit);
/// Points of a picture, in tenths of a pixel, at most so many of them, evenly taken; those beside the picture are left
/// out.
[[nodiscard]] Json picture_points(std::span<const std::array<float, 2>> points, std::size_t most);
/// The fact that only a cell's first repetition repeats, and the file of a scene that it belongs to.
inline constexpr const char* kLeakPoints = "leak_points";
[[nodiscard]] std::string seen_points_file(const std::string& scene);
[[nodiscard]] bool is_seen_points_file(std::string_view name);
/// The cell's name as fields of their own; `threads` as a number.
void add_axes(Json& json, const Cell& cell);

/// One repetition as an entry of results.json, Google Benchmark's fields first. Times are of one iteration,
/// in ms.
[[nodiscard]] Json repetition_entry(const CellResult& result, const Repetition& repetition);
/// mean, median, stddev and cv, as Google Benchmark writes them; the median holds the interval of the rate too
/// (median_interval()), which one repetition has not.
[[nodiscard]] std::vector<Json> aggregate_entries(const CellResult& result);
/// The cell as a line of cells.jsonl.
[[nodiscard]] Json cell_line(const CellResult& result, const std::string& configuration_hash);
/// Reads a line of cells.jsonl back. std::nullopt when it is not one, or not of `cell` or the configuration.
[[nodiscard]] std::optional<CellResult> parse_cell_line(const Json& line, const Cell& cell,
                                                        const std::string& configuration_hash);
/// One repetition as a line of the journal, and back.
[[nodiscard]] Json journal_line(const std::string& name, const Repetition& repetition);
[[nodiscard]] std::optional<std::pair<std::string, Repetition>> parse_journal_line(const Json& line);

}  // namespace arboretum
