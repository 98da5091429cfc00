#include "experiments/results_writer.h"

#include <algorithm>
#include <iterator>
#include <set>
#include <vector>

#include "experiments/json_text.h"

namespace arboretum {
namespace {

/// Nested objects become columns of their own: phase_seconds.collapse.
Json flattened(const Json& entry) {
  Json flat = Json::object();
  for (const auto& [key, value] : entry.items()) {
    if (!value.is_object())
      flat[key] = value;
    else
      for (const auto& [inner, number] : value.items()) flat[key + "." + inner] = number;
  }
  return flat;
}

/// A coefficient of variation is a ratio and keeps its value.
void express_in(Json& entry, const std::string& unit) {
  if (unit == "ms") return;
  const double factor = unit == "ns" ? 1e6 : unit == "us" ? 1e3 : 1e-3;
  if (entry.value("aggregate_unit", "time") == "time")
    for (const char* key : {"real_time", "cpu_time"}) entry[key] = entry[key].get<double>() * factor;
  entry["time_unit"] = unit;
}

/// Whether some repetitions are of another machine or revision than others.
bool has_several_origins(const RunOutcome& outcome) {
  std::set<Origin> origins;
  for (const CellResult& result : outcome.results)
    for (const Repetition& repetition : result.repetitions) origins.insert(repetition.origin);
  return origins.size() > 1;
}

/// `origins`: repetitions say where they are from.
std::vector<Json> entries_of(const CellResult& result, const ResultForm& form, bool repetitions, bool aggregates,
                             bool origins) {
  std::vector<Json> entries;
  if (repetitions) {
    for (const Repetition& repetition : result.repetitions) {
      Json& entry = entries.emplace_back(repetition_entry(result, repetition));
      if (origins) add_origin(entry, repetition.origin);
    }
  }
  if (aggregates) std::ranges::move(aggregate_entries(result), std::back_inserter(entries));
  for (Json& entry : entries) express_in(entry, form.time_unit);
  return entries;
}

}  // namespace

std::string plain_text(const Json& value) { return value.is_string() ? value.get<std::string>() : to_text(value); }

std::string csv_field(const Json& value) {
  std::string text = plain_text(value);
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

std::string results_json(const RunOutcome& outcome, const Plan& plan, Json context, const ResultForm& form) {
  context["cells"] = outcome.results.size();
  context["excluded_cells"] = plan.excluded;
  context["filtered_cells"] = plan.filtered;
  context["skipped_cells"] = plan.skipped.size() + outcome.failed.size();
  if (!outcome.missing.empty()) context["missing_cells"] = outcome.missing.size();
  if (!outcome.warnings.empty()) context["warnings"] = outcome.warnings;
  Json document = Json::object();
  document["context"] = std::move(context);
  Json& benchmarks = document["benchmarks"] = Json::array();
  const bool origins = has_several_origins(outcome);
  for (std::size_t i = 0; i < outcome.results.size(); ++i) {
    for (Json& entry : entries_of(outcome.results[i], form, !form.aggregates_only, true, origins)) {
      entry["family_index"] = i, entry["per_family_instance_index"] = 0;
      benchmarks.push_back(std::move(entry));
    }
  }
  Json& skipped = document["skipped"] = Json::array();
  for (const auto* list : {&plan.skipped, &outcome.failed})
    for (const SkippedCell& cell : *list) skipped.push_back({{"name", cell.name}, {"reason", cell.reason}});
  if (!outcome.missing.empty()) document["missing"] = outcome.missing;
  return to_text(document, 1) + "\n";
}

std::string results_csv(const RunOutcome& outcome, const ResultForm& form) {
  std::vector<Json> rows;
  std::vector<std::string> columns;
  const bool origins = has_several_origins(outcome);
  for (const CellResult& result : outcome.results) {
    for (const Json& entry : entries_of(result, form, !form.aggregates_only, form.aggregates_only, origins)) {
      rows.push_back(flattened(entry));
      for (const auto& [key, value] : rows.back().items())
        if (std::ranges::find(columns, key) == columns.end()) columns.push_back(key);
    }
  }
  std::string text;
  for (std::size_t i = 0; i < columns.size(); ++i) text += (i ? "," : "") + columns[i];
  text += "\n";
  for (const Json& row : rows) {
    for (std::size_t i = 0; i < columns.size(); ++i) {
      if (i) text += ",";
      if (const auto value = row.find(columns[i]); value != row.end()) text += csv_field(*value);
    }
    text += "\n";
  }
  return text;
}

}  // namespace arboretum
