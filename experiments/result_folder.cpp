#include "experiments/result_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <map>
#include <system_error>

#include "core/error.h"
#include "core/names.h"
#include "core/whole_file.h"
#include "experiments/append_file.h"
#include "experiments/json_text.h"
#include "experiments/results_writer.h"

namespace arboretum {
namespace {

namespace fs = std::filesystem;

bool is_result_folder(const fs::path& path) {
  std::error_code ignored;
  return fs::exists(path / "cells.jsonl", ignored) || fs::exists(path / "results.json", ignored);
}

/// Result folders directly below a folder.
std::vector<std::string> folders_in(const fs::path& path) {
  std::vector<std::string> found;
  std::error_code error;
  for (fs::directory_iterator entry(path, error), end; !error && entry != end; entry.increment(error))
    if (is_result_folder(entry->path())) found.push_back(entry->path().lexically_normal().string());
  std::ranges::sort(found);
  return found;
}

[[noreturn]] void refuse(const fs::path& path) {
  std::error_code ignored;
  const bool is_folder = fs::is_directory(path, ignored), is_there = fs::exists(path, ignored);
  std::string what = is_folder  ? "no result folder: neither cells.jsonl nor results.json in it"
                     : is_there ? "a file; give the folder that `run` wrote"
                                : "no such folder";
  const std::string text = path.lexically_normal().string();
  // Within or around what was named a folder may be called anything; beside it only what is spelt alike is meant.
  std::vector<std::string> near;
  if (is_folder) near = folders_in(path);
  if (near.empty() && is_result_folder(path.parent_path())) near = {path.parent_path().string()};
  std::string meant = nearest_name(text, near);
  for (const fs::path& beside : {path.has_parent_path() ? path.parent_path() : fs::path("."), fs::path("results")})
    if (meant.empty()) meant = close_name(text, folders_in(beside));
  throw UserError(meant.empty() ? fmt::format("{}: {}; `arboretum run` makes result folders", path.string(), what)
                                : fmt::format("{}: {}; did you mean '{}'?", path.string(), what, meant));
}

Json read_json(const fs::path& path) {
  const std::string text = read_whole(path);
  try {
    Json document = Json::parse(text);
    if (document.is_object() && document.value("context", Json::object()).is_object()) return document;
  } catch (const nlohmann::json::parse_error& e) {
    fail_syntax(path, text, e, "copy the folder anew, or measure again");
  } catch (const nlohmann::json::exception&) {
  }
  throw UserError(
      fmt::format("{}: not the JSON that `run` writes; copy the folder anew, or measure again", path.string()));
}

Repetition repetition_of(const Json& entry) {
  Repetition r;
  r.index = entry.at("repetition_index").get<unsigned>();
  r.iterations = entry.at("iterations").get<std::uint64_t>();
  const double scale = 1e-3 * static_cast<double>(r.iterations);
  r.wall_seconds = entry.at("real_time").get<double>() * scale;
  r.cpu_seconds = entry.at("cpu_time").get<double>() * scale;
  r.origin = read_origin(entry);
  return r;
}

/// From results.json alone. Its repetitions repeat the cell's facts.
void read_entries(const Json& document, ResultFolder& folder) {
  std::map<std::string, std::size_t> places;
  for (const Json& entry : document.value("benchmarks", Json::array())) {
    if (entry.at("run_type") != "iteration") continue;
    const auto [place, fresh] = places.try_emplace(entry.at("run_name").get<std::string>(), folder.cells.size());
    if (fresh) folder.cells.push_back({.cell = cell_of(entry), .repetitions = {}, .facts = entry});
    folder.cells[place->second].repetitions.push_back(repetition_of(entry));
  }
}

void read_lines_of_cells(const fs::path& file, ResultFolder& folder) {
  std::map<std::string, std::size_t> places;
  std::size_t number = 0;
  for (const std::string& text : read_lines(file)) {
    ++number;
    Json line = Json::parse(text, nullptr, false);
    std::optional<CellResult> result;
    try {
      const std::string hash = line.at("configuration_hash").get<std::string>();
      if (folder.configuration_hash.empty()) folder.configuration_hash = hash;
      result = parse_cell_line(line, cell_of(line), folder.configuration_hash);
    } catch (const nlohmann::json::exception&) {
    }
    if (!result) {
      throw UserError(fmt::format(
          "{}:{}: not a cell as `run` writes it; take the line out (its cell is then missing), or copy the folder anew",
          file.string(), number));
    }
    const auto [place, fresh] = places.try_emplace(result->cell.name(), folder.cells.size());
    if (fresh) {
      folder.cells.push_back(std::move(*result)), folder.lines.push_back(std::move(line));
    } else {
      folder.cells[place->second] = std::move(*result), folder.lines[place->second] = std::move(line);
    }
  }
}

/// Cells as the plan has them, not as they ended; without a plan as results.json has them. Others stay behind, in their
/// order.
void sort_as_planned(ResultFolder& folder, const Json& document) {
  std::map<std::string, std::size_t> places;
  if (folder.plan) {
    for (const PlanRecord::Entry& entry : folder.plan->cells) places.try_emplace(entry.name, places.size());
  } else {
    for (const Json& entry : document.value("benchmarks", Json::array()))
      places.try_emplace(entry.at("run_name").get<std::string>(), places.size());
  }
  std::vector<std::pair<std::size_t, std::size_t>> order;
  for (std::size_t i = 0; i < folder.cells.size(); ++i) {
    const auto place = places.find(folder.cells[i].cell.name());
    order.emplace_back(place != places.end() ? place->second : places.size(), i);
  }
  std::ranges::sort(order);
  std::vector<CellResult> cells;
  std::vector<Json> lines;
  for (const auto& [place, i] : order) {
    cells.push_back(std::move(folder.cells[i]));
    if (!folder.lines.empty()) lines.push_back(std::move(folder.lines[i]));
  }
  folder.cells = std::move(cells), folder.lines = std::move(lines);
}

/// A value of a context as a line shows it.
std::string text_of(const Json& context, const char* key) {
  const auto found = context.find(key);
  if (found == context.end()) return "unknown";
  if (!found->is_array()) return plain_text(*found);
  std::vector<std::string> words;
  for (const Json& word : *found) words.push_back(plain_text(word));
  return fmt::format("{}", fmt::join(words, " "));
}

/// A key and what is swept of it: "binned_sah:bins=16" is "binned_sah" and ":bins=16".
void part(const std::string& text, std::string& key, std::string& label) {
  const std::size_t colon = text.find(':');
  key = text.substr(0, colon);
  label = colon == std::string::npos ? "" : text.substr(colon);
}

/// From plan.json, which has all of the other contexts, else from the warnings that the results have of them.
std::vector<std::string> begun_under(const ResultFolder& folder) {
  std::vector<std::string> begun;
  if (folder.plan) {
    for (const Json& earlier : folder.plan->earlier)
      std::ranges::move(differing_conditions(earlier, folder.context), std::back_inserter(begun));
    return begun;
  }
  for (const Json& warning : folder.context.value("warnings", Json::array()))
    if (warning.is_string() && warning.get<std::string>().starts_with("begun ")) begun.push_back(warning);
  return begun;
}

constexpr std::string_view kBetween = " | ";  // values of a merged context that differ

}  // namespace

std::string ResultFolder::context_text(const char* key) const { return text_of(context, key); }

std::string hash_of_configuration(const fs::path& folder) {
  std::ifstream stream(folder / "effective.yaml");
  std::string line;
  constexpr std::string_view kHead = kConfigurationHashHead;
  return std::getline(stream, line) && line.starts_with(kHead) ? line.substr(kHead.size()) : "";
}

Cell cell_of(const Json& entry) {
  const auto text = [&](const char* key) { return entry.at(key).get<std::string>(); };
  Cell cell;
  cell.metric = text("metric") == "build" ? Cell::Metric::build : Cell::Metric::trace;
  cell.scene = text("scene"), cell.structure = text("structure"), cell.leaf = text("leaf");
  cell.intersector = text("intersector"), cell.box = text("box");
  part(text("builder"), cell.builder, cell.parameter_label);
  part(text("traversal"), cell.traversal, cell.setting_label);
  cell.call = entry.value("call", cell.call);
  part(text("workload"), cell.workload, cell.start_label);
  cell.isa = parse_isa(text("isa")).value_or(Isa::scalar);
  cell.threads = entry.at("threads").get<unsigned>();
  return cell;
}

ResultFolder read_result_folder(const fs::path& path) {
  if (!is_result_folder(path)) refuse(path);
  ResultFolder folder;
  folder.path = path;
  folder.configuration_hash = hash_of_configuration(path);
  folder.plan = read_plan_record(path);
  if (folder.plan) folder.context = folder.plan->context;
  folder.complete = fs::exists(path / "results.json");
  Json document = Json::object();
  if (folder.complete) {
    document = read_json(path / "results.json");
    folder.context = document.value("context", Json::object());
    if (folder.configuration_hash.empty()) folder.configuration_hash = folder.context.value("configuration_hash", "");
  }
  try {
    if (fs::exists(path / "cells.jsonl"))
      read_lines_of_cells(path / "cells.jsonl", folder);
    else
      read_entries(document, folder);
    sort_as_planned(folder, document);
    for (const Json& cell : document.value("skipped", Json::array()))
      folder.skipped.push_back({cell.at("name").get<std::string>(), cell.at("reason").get<std::string>()});
  } catch (const nlohmann::json::exception&) {
    throw UserError(fmt::format("{}: not the results that `run` writes; copy the folder anew, or measure again",
                                (path / "results.json").string()));
  }
  folder.begun = begun_under(folder);
  // What runs of older revisions did not say of each repetition, where the folder is of one of them alone.
  if (folder.begun.empty()) name_origins(folder.cells, origin_of(folder.context));
  if (!folder.complete && folder.plan) {
    for (const PlanRecord::Entry& cell : folder.plan->skipped)
      if (cell.shard == folder.plan->shard.index) folder.skipped.push_back({cell.name, cell.reason});
  }
  return folder;
}

std::vector<std::string> machine_differences(const Json& a, const Json& b) {
  constexpr std::pair<const char*, const char*> kKeys[] = {{"cpu", "CPU"},
                                                           {"cores", "cores"},
                                                           {"governor", "CPU governor"},
                                                           {"isa", "instruction sets"},
                                                           {"compiler", "compiler"},
                                                           {"compiler_flags", "compiler flags"},
                                                           {"build_type", "build type"}};
  std::vector<std::string> differences;
  for (const auto& [key, title] : kKeys) {
    const std::string of_a = text_of(a, key), of_b = text_of(b, key);
    if (of_a != of_b) differences.push_back(fmt::format("{}: {} against {}", title, of_a, of_b));
  }
  return differences;
}

std::vector<std::string> differing_conditions(const Json& before, const Json& now) {
  std::vector<std::string> differences;
  for (const std::string& difference : machine_differences(before, now))
    differences.push_back(kBegunElsewhere + difference);
  if (before.value("git_revision", "") != now.value("git_revision", ""))
    differences.push_back(
        fmt::format("begun at revision {}, gone on with at {}", short_revision(before), short_revision(now)));
  return differences;
}

std::vector<std::string> begun_elsewhere(const std::vector<std::string>& begun) {
  std::vector<std::string> differences;
  for (const std::string& difference : begun)
    if (difference.starts_with(kBegunElsewhere))
      differences.push_back(difference.substr(std::string_view(kBegunElsewhere).size()));
  return differences;
}

std::string short_revision(const Json& context) {
  const std::string all = text_of(context, "git_revision");
  std::vector<std::string> each;
  for (std::size_t begin = 0, end = 0; end != std::string::npos; begin = end + kBetween.size()) {
    end = all.find(kBetween, begin);
    each.push_back(all.substr(begin, std::min<std::size_t>(12, end - begin)));
  }
  return fmt::format("{}", fmt::join(each, kBetween));
}

Origin origin_of(const Json& context) {
  const Origin origin = read_origin(context);
  const auto several = [](const std::string& text) { return text.find(kBetween) != std::string::npos; };
  return several(origin.cpu) || several(origin.git_revision) ? Origin{} : origin;
}

}  // namespace arboretum
