#include "experiments/comparison_files.h"

#include <fmt/format.h>

#include "experiments/comparison_text.h"
#include "experiments/json_text.h"
#include "experiments/results_writer.h"

namespace arboretum {
namespace {

Json interval_json(const Interval& i) { return {{"median", i.median}, {"low", i.low}, {"high", i.high}}; }

/// One cell, flat: the columns of the CSV.
Json cell_json(const ComparedCell& c) {
  Json json = Json::object();
  json["name"] = c.a.cell.name();
  add_axes(json, c.a.cell);
  json["rate"] = c.is_trace() ? (c.a.cell.threads == 1 ? "rays_per_cpu_second" : "rays_per_second")
                              : (c.a.cell.threads == 1 ? "triangles_per_cpu_second" : "triangles_per_second");
  json["rate_a"] = c.rate_a, json["rate_b"] = c.rate_b;
  json["ratio"] = c.ratio.median;
  json["ratio_low"] = c.is_tested() ? Json(c.ratio.low) : Json();
  json["ratio_high"] = c.is_tested() ? Json(c.ratio.high) : Json();
  json["test"] = to_string(c.test), json["p"] = c.is_tested() ? Json(c.p) : Json(),
  json["adjusted_p"] = c.is_tested() ? Json(c.adjusted_p) : Json();
  json["verdict"] = to_string(c.verdict), json["equal"] = c.equal, json["beyond"] = c.beyond;
  json["repetitions_a"] = c.a.repetitions.size(), json["repetitions_b"] = c.b.repetitions.size();
  for (const char* fact : {"rays", "checked_rays", "wrong_answers", "sah_cost", "bytes"}) {
    for (const auto& [letter, result] : {std::pair{"a", &c.a}, std::pair{"b", &c.b}})
      json[fmt::format("{}_{}", fact, letter)] = result->has_fact(fact) ? result->facts[fact] : Json();
  }
  return json;
}

Json mean_json(const MeanRatio& m) {
  return {{"axis", m.axis.empty() ? "all" : m.axis},
          {"value", m.value},
          {"ratio", interval_json(m.ratio)},
          {"cells", m.cells},
          {"faster", m.faster},
          {"slower", m.slower},
          {"indistinguishable", m.indistinguishable},
          {"undecided", m.undecided}};
}

Json folder_json(const ResultFolder& folder) {
  return {{"folder", folder.path.string()},
          {"complete", folder.complete},
          {"cells", folder.cells.size()},
          {"begun", folder.begun},
          {"context", folder.context}};
}

}  // namespace

std::string comparison_json(const Comparison& comparison, const ResultFolder& a, const ResultFolder& b) {
  const CompareOptions& o = comparison.options;
  const auto [status, why] = verdict(comparison);
  Json json = Json::object();
  json["verdict"] = why, json["exit_status"] = static_cast<int>(status);
  json["options"] = {{"min_difference_percent", o.min_difference},
                     {"significance", o.significance},
                     {"control", o.control},
                     {"strict", o.strict},
                     {"allow_different_settings", o.allow_different_settings}};
  json["a"] = folder_json(a), json["b"] = folder_json(b);
  Json& differences = json["differences"] = Json::array();
  for (const std::string& line : machine_differences(a.context, b.context)) differences.push_back(line);
  for (const SettingDifference& d : o.settings) differences.push_back(d.text());
  Json& cells = json["cells"] = Json::array();
  for (const ComparedCell& c : comparison.cells) cells.push_back(cell_json(c));
  Json& means = json["geometric_means"] = Json::array();
  for (const MeanRatio& m : comparison.means) means.push_back(mean_json(m));
  for (const auto& [kind, control] :
       {std::pair{"rays", &comparison.control_of_rays}, std::pair{"builds", &comparison.control_of_builds}})
    if (*control) json["control"][kind] = {{"cells", (*control)->cells}, {"ratio", interval_json((*control)->ratio)}};
  Json& incomparable = json["incomparable"] = Json::array();
  for (const auto& [name, reason] : comparison.incomparable)
    incomparable.push_back({{"name", name}, {"reason", reason}});
  json["only_a"] = comparison.only_a, json["only_b"] = comparison.only_b;
  return to_text(json, 1) + "\n";
}

std::string comparison_csv(const Comparison& comparison) {
  std::string text;
  for (const ComparedCell& c : comparison.cells) {
    const Json row = cell_json(c);
    if (text.empty()) {
      for (const auto& [key, value] : row.items()) text += (text.empty() ? "" : ",") + key;
      text += "\n";
    }
    bool first = true;
    for (const auto& [key, value] : row.items()) {
      if (!first) text += ",";
      first = false;
      if (!value.is_null()) text += csv_field(value);
    }
    text += "\n";
  }
  return text;
}

}  // namespace arboretum
