#include "experiments/plan_record.h"

#include <fmt/format.h>

#include <set>
#include <system_error>

#include "core/error.h"
#include "core/whole_file.h"
#include "experiments/json_text.h"

namespace arboretum {
namespace {

Json entries_json(const std::vector<PlanRecord::Entry>& entries) {
  Json list = Json::array();
  for (const PlanRecord::Entry& entry : entries) {
    Json& item = list.emplace_back(Json{{"name", entry.name}, {"shard", entry.shard}});
    if (!entry.reason.empty()) item["reason"] = entry.reason;
  }
  return list;
}

std::vector<PlanRecord::Entry> entries_of(const Json& list) {
  std::vector<PlanRecord::Entry> entries;
  for (const Json& item : list)
    entries.push_back({item.at("name").get<std::string>(), item.value("shard", 1u), item.value("reason", "")});
  return entries;
}

}  // namespace

PlanRecord record_of(const Plan& plan, const std::map<std::string, unsigned>& shards, const Shard& shard) {
  PlanRecord record;
  record.shard = shard;
  record.excluded = plan.excluded, record.filtered = plan.filtered;
  const auto shard_of = [&](const std::string& name) { return shard.is_whole() ? 1u : shards.at(name); };
  for (const Cell& cell : plan.cells) record.cells.push_back({cell.name(), shard_of(cell.name()), ""});
  for (const SkippedCell& cell : plan.skipped) record.skipped.push_back({cell.name, shard_of(cell.name), cell.reason});
  return record;
}

void keep_measured(Plan& plan, PlanRecord& record, const Plan& whole, const std::map<std::string, CellResult>& done) {
  std::set<std::string> wanted;
  for (const Cell& cell : plan.cells) wanted.insert(cell.name());
  std::map<std::string, unsigned> recorded;
  for (const PlanRecord::Entry& entry : record.cells) recorded.emplace(entry.name, entry.shard);
  std::vector<Cell> cells;
  std::vector<PlanRecord::Entry> entries;
  std::set<std::string> kept;
  for (const auto* list : {&whole.cells, &whole.elsewhere}) {
    for (const Cell& cell : *list) {
      const std::string name = cell.name();
      const bool now = wanted.contains(name), before = !now && done.contains(name);
      if (before) kept.insert(name);
      if (now || before) cells.push_back(cell);
      if (before || recorded.contains(name))
        entries.push_back({name, before ? record.shard.index : recorded.at(name), ""});
      if (before && !recorded.contains(name) && list == &whole.cells && plan.filtered > 0) --plan.filtered;
      if (before && recorded.contains(name) && recorded.at(name) != record.shard.index && plan.in_other_shards > 0)
        --plan.in_other_shards;
    }
  }
  std::erase_if(plan.skipped, [&](const SkippedCell& cell) { return kept.contains(cell.name); });
  std::erase_if(record.skipped, [&](const PlanRecord::Entry& entry) { return kept.contains(entry.name); });
  plan.cells = std::move(cells), record.cells = std::move(entries), record.filtered = plan.filtered;
}

std::string to_text(const PlanRecord& record) {
  Json json = Json::object();
  json["context"] = record.context;
  if (!record.earlier.empty()) json["earlier_contexts"] = record.earlier;
  json["shard"] = record.shard.text();
  json["filter"] = record.filter, json["skip"] = record.skip;
  if (!record.geometry.empty()) json["geometry"] = record.geometry;
  json["excluded"] = record.excluded, json["filtered"] = record.filtered;
  json["cells"] = entries_json(record.cells), json["skipped"] = entries_json(record.skipped);
  return to_text(json, 1) + "\n";
}

std::optional<PlanRecord> read_plan_record(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / kPlanFile;
  std::error_code ignored;
  if (std::filesystem::status(file, ignored).type() == std::filesystem::file_type::not_found) return std::nullopt;
  const std::string text = read_whole(file);
  try {
    const Json json = Json::parse(text);
    PlanRecord record;
    record.context = json.at("context");
    for (const Json& context : json.value("earlier_contexts", Json::array())) record.earlier.push_back(context);
    record.shard = parse_shard(json.at("shard").get<std::string>());
    record.filter = json.value("filter", ""), record.skip = json.value("skip", "");
    record.excluded = json.value("excluded", std::size_t{0}), record.filtered = json.value("filtered", std::size_t{0});
    record.geometry = json.value("geometry", record.geometry);
    record.cells = entries_of(json.at("cells")), record.skipped = entries_of(json.at("skipped"));
    return record;
  } catch (const nlohmann::json::parse_error& e) {
    fail_syntax(file, text, e, "copy the folder anew, or measure again");
  } catch (const nlohmann::json::exception&) {
    throw UserError(
        fmt::format("{}: not the plan that `run` writes; copy the folder anew, or measure again", file.string()));
  }
}

}  // namespace arboretum
