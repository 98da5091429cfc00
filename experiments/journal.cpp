#include "experiments/journal.h"

#include <fmt/format.h>

#include "core/error.h"
#include "experiments/json_text.h"

namespace arboretum {
namespace {

Json parse(const std::string& line) { return Json::parse(line, nullptr, false); }

void refuse_damaged(const Json& line, const std::filesystem::path& file, std::size_t number) {
  const auto refuse = [&](const std::string& why) {
    throw UserError(
        fmt::format("{}:{}: not a line as `run` writes it: {}; take the line out, and what it told is measured again",
                    file.string(), number, why));
  };
  if (!line.is_object()) refuse("no JSON object");
  for (const char* key : {"name", "configuration_hash"})
    if (!line.contains(key) || !line.at(key).is_string()) refuse(fmt::format("no {}", key));
}

}  // namespace

void refuse_other_configuration(const std::filesystem::path& folder, const std::string& there,
                                const std::string& here) {
  if (there == here) return;
  throw UserError(
      fmt::format("{}: holds another configuration (hash {}, this one is {}); resume with the command that began it, "
                  "or choose another folder with --out",
                  folder.string(), there, here));
}

Journal::Journal(std::filesystem::path folder, std::string configuration_hash, const Plan& plan, bool resume)
    : folder_(std::move(folder)), hash_(std::move(configuration_hash)) {
  const std::filesystem::path cells = folder_ / "cells.jsonl", repetitions = folder_ / "repetitions.jsonl";
  if (resume) {
    std::map<std::string, const Cell*> wanted;
    for (const auto* list : {&plan.cells, &plan.elsewhere})
      for (const Cell& cell : *list) wanted.emplace(cell.name(), &cell);
    for (const auto& path : {cells, repetitions}) {
      std::size_t number = 0;
      for (const std::string& text : read_lines(path)) {
        const Json line = parse(text);
        ++number;
        refuse_damaged(line, path, number);
        refuse_other_configuration(folder_, line.at("configuration_hash"), hash_);
        const auto found = wanted.find(line.at("name").get<std::string>());
        if (found == wanted.end()) continue;
        if (path == cells) {
          if (auto result = parse_cell_line(line, *found->second, hash_))
            done_.insert_or_assign(found->first, std::move(*result));
        } else if (const auto entry = parse_journal_line(line)) {
          started_[entry->first].insert_or_assign(entry->second.index, entry->second);
        }
      }
    }
  }
  cells_ = AppendFile(cells, resume);
  repetitions_ = AppendFile(repetitions, resume);
}

std::vector<Repetition> Journal::started(const std::string& name) const {
  std::vector<Repetition> list;
  if (const auto found = started_.find(name); found != started_.end()) {
    for (const auto& [index, repetition] : found->second) list.push_back(repetition);
  }
  return list;
}

void Journal::add(const std::string& name, const Repetition& repetition) {
  Json line = journal_line(name, repetition);
  line["configuration_hash"] = hash_;
  repetitions_.append(to_text(line));
}

void Journal::finish(const CellResult& result) { cells_.append(to_text(cell_line(result, hash_))); }

}  // namespace arboretum
