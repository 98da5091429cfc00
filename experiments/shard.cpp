#include "experiments/shard.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <tuple>
#include <vector>

#include "core/error.h"
#include "experiments/estimate.h"

namespace arboretum {
namespace {

constexpr unsigned kMostShards = 100'000;
/// A cut moves by so much of a shard where that keeps a structure's cells together.
constexpr double kSlack = 0.125;

/// `scene/structure/builder/leaf` of a cell's name: what of a structure is built once, instruction sets and threads
/// apart.
std::string structure_of(const std::string& name) {
  std::size_t begin = name.find('/') + 1, end = begin;
  for (int parts = 0; parts < 4 && end != std::string::npos; ++parts) end = name.find('/', parts ? end + 1 : end);
  return name.substr(begin, end == std::string::npos ? end : end - begin);
}

/// A cell on the line that is cut.
struct Place {
  std::string structure, name;
  std::uint64_t weight = 0;  ///< microseconds; whole numbers, for sums that are the same everywhere
};

std::vector<Place> line_of(const Experiment& experiment, const Plan& plan) {
  std::vector<Place> line;
  const auto add = [&](const std::vector<Cell>& cells) {
    const std::vector<double> seconds = estimate_seconds(experiment, cells);
    for (std::size_t i = 0; i < cells.size(); ++i) {
      std::string name = cells[i].name();
      line.push_back({structure_of(name), name, 1 + static_cast<std::uint64_t>(seconds[i] * 1e6)});
    }
  };
  add(plan.cells), add(plan.elsewhere);
  for (const SkippedCell& cell : plan.skipped) line.push_back({structure_of(cell.name), cell.name, 0});
  // Of equal names the one that weighs comes first and stays.
  std::ranges::sort(line, [](const Place& a, const Place& b) {
    return std::tie(a.structure, a.name, b.weight) < std::tie(b.structure, b.name, a.weight);
  });
  line.erase(std::unique(line.begin(), line.end(), [](const Place& a, const Place& b) { return a.name == b.name; }),
             line.end());
  return line;
}

}  // namespace

std::string Shard::text() const { return fmt::format("{}/{}", index, of); }

Shard parse_shard(const std::string& text) {
  Shard shard;
  const char* end = text.data() + text.size();
  const auto [slash, bad_index] = std::from_chars(text.data(), end, shard.index);
  bool good = bad_index == std::errc{} && slash != end && *slash == '/';
  if (good) {
    const auto [rest, bad_count] = std::from_chars(slash + 1, end, shard.of);
    good = bad_count == std::errc{} && rest == end && shard.index >= 1 && shard.index <= shard.of &&
           shard.of <= kMostShards;
  }
  if (!good)
    throw UserError(
        fmt::format("--shard '{}': must be I/N, the I-th of N parts with I from 1 to N (at most {}), as in --shard 2/8",
                    text, kMostShards));
  return shard;
}

std::map<std::string, unsigned> split_plan(const Experiment& experiment, const Plan& plan, unsigned of) {
  const std::vector<Place> line = line_of(experiment, plan);
  std::vector<double> before{0.0};  // weight in front of each place; whole numbers below 2^53
  for (const Place& place : line) before.push_back(before.back() + static_cast<double>(place.weight));
  std::vector<std::size_t> borders;  // places at which another structure begins
  for (std::size_t i = 0; i <= line.size(); ++i)
    if (i == 0 || i == line.size() || line[i].structure != line[i - 1].structure) borders.push_back(i);

  const auto distance = [&](std::size_t place, double at) { return std::abs(before[place] - at); };
  std::vector<std::size_t> cuts;
  for (unsigned k = 1; k < of; ++k) {
    const double share = before.back() / of, at = share * k;
    std::size_t cut = static_cast<std::size_t>(std::ranges::lower_bound(before, at) - before.begin());
    if (cut > 0 && distance(cut - 1, at) <= distance(cut, at)) --cut;
    const std::size_t border =
        *std::ranges::min_element(borders, {}, [&](std::size_t place) { return distance(place, at); });
    if (distance(border, at) <= kSlack * share) cut = border;
    cuts.push_back(std::max(cut, cuts.empty() ? 0 : cuts.back()));
  }
  std::map<std::string, unsigned> shards;
  for (std::size_t i = 0; i < line.size(); ++i)
    shards.emplace(line[i].name, static_cast<unsigned>(std::ranges::upper_bound(cuts, i) - cuts.begin()) + 1);
  return shards;
}

void keep_shard(Plan& plan, const std::map<std::string, unsigned>& shards, unsigned index) {
  const std::size_t before = plan.cells.size();
  std::erase_if(plan.cells, [&](const Cell& cell) { return shards.at(cell.name()) != index; });
  std::erase_if(plan.skipped, [&](const SkippedCell& cell) { return shards.at(cell.name) != index; });
  plan.in_other_shards += before - plan.cells.size();
}

}  // namespace arboretum
