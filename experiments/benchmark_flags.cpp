#include "experiments/benchmark_flags.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <set>

#include "core/error.h"
#include "core/names.h"
#include "core/parse_number.h"
#include "experiments/config.h"

namespace arboretum {
namespace {

template <class T>
T number(const std::string& flag, std::string text, T low, T high) {
  if (text.ends_with('s')) text.pop_back();  // newer releases write 0.5s
  const std::optional<T> value = parse_number<T>(text);
  if (!value || !(*value >= low && *value <= high))
    throw UserError(fmt::format("{}: a number from {} to {}, not '{}'", flag, low, high, text));
  return *value;
}

std::string one_of(const std::string& flag, const std::string& value, std::initializer_list<std::string_view> allowed) {
  for (std::string_view a : allowed)
    if (a == value) return value;
  throw UserError(fmt::format("{}: one of {}, not '{}'", flag, fmt::join(allowed, ", "), value));
}

/// A flag without a value is on. Google Benchmark itself takes every word for true that it does not know for false.
bool truth(const std::string& flag, const std::string& value) {
  const std::string word =
      one_of(flag, value.empty() ? "true" : value, {"true", "false", "1", "0", "yes", "no", "on", "off"});
  return !(word == "false" || word == "0" || word == "no" || word == "off");
}

std::vector<std::pair<std::string, std::string>> pairs(const std::string& flag, const std::string& value) {
  std::vector<std::pair<std::string, std::string>> list;
  for (std::size_t begin = 0; begin <= value.size();) {
    const std::size_t end = std::min(value.find(',', begin), value.size()), equals = value.find('=', begin);
    if (equals == begin || equals >= end)
      throw UserError(fmt::format("{}: key=value,key=value, not '{}'", flag, value));
    std::string key = value.substr(begin, equals - begin);
    for (const auto& known : list)
      if (known.first == key) throw UserError(fmt::format("{}: '{}' is given twice; keep one", flag, key));
    list.emplace_back(std::move(key), value.substr(equals + 1, end - equals - 1));
    begin = end + 1;
  }
  return list;
}

/// As Google Benchmark reads it: `all` is every name, a `-` in front takes the names that the rest does not find.
void read_filter(BenchmarkFlags& flags, const std::string& value) {
  if (value == "all") return;
  if (!value.starts_with('-'))
    flags.filter = value;
  else
    flags.skip = value == "-" ? "." : value.substr(1);
}

/// Flags of Google Benchmark's that change nothing here, and why.
std::string_view why_without_effect(std::string_view flag) {
  if (flag == "--benchmark_color") return "tables are printed without colours";
  if (flag == "--benchmark_counters_tabular") return "counters are columns of results.csv and of the report";
  if (flag == "--benchmark_perf_counters")
    return "hardware counters are not read; nodes and triangles a ray are counted in a pass of their own";
  return {};
}

/// Flags that only say something of another, without that other.
void refuse_lonely(const BenchmarkFlags& flags, bool out_format_given) {
  const bool displays = flags.format != "console", copies = !flags.out.empty();
  if (out_format_given && !copies)
    throw UserError("--benchmark_out_format has no effect without --benchmark_out: add it or take the format out");
  for (const auto& [flag, is_set] : {std::pair{"--benchmark_time_unit", flags.time_unit != "ms"},
                                     {"--benchmark_report_aggregates_only", flags.report_aggregates_only}})
    if (is_set && !displays && !copies)
      throw UserError(
          fmt::format("{} has no effect on the table and the result folder, which keeps repetitions in ms; add "
                      "--benchmark_out=FILE or "
                      "--benchmark_format=json, to which it applies",
                      flag));
  if (flags.display_aggregates_only && !displays)
    throw UserError(
        "--benchmark_display_aggregates_only has no effect on the table, which shows medians; add "
        "--benchmark_format=json or csv, to which it applies");
}

}  // namespace

BenchmarkFlags take_benchmark_flags(std::vector<std::string>& words) {
  const std::vector<std::string> known{"--benchmark_context",
                                       "--benchmark_display_aggregates_only",
                                       "--benchmark_enable_random_interleaving",
                                       "--benchmark_filter",
                                       "--benchmark_format",
                                       "--benchmark_list_tests",
                                       "--benchmark_min_time",
                                       "--benchmark_min_warmup_time",
                                       "--benchmark_out",
                                       "--benchmark_out_format",
                                       "--benchmark_repetitions",
                                       "--benchmark_report_aggregates_only",
                                       "--benchmark_time_unit"};
  BenchmarkFlags flags;
  std::vector<std::string> rest;
  std::set<std::string> given;
  for (const std::string& word : words) {
    if (!word.starts_with("--benchmark_")) {
      rest.push_back(word);
      continue;
    }
    const std::size_t equals = word.find('=');
    const std::string flag = word.substr(0, equals);
    const std::string value = equals == std::string::npos ? "" : word.substr(equals + 1);
    if (const std::string_view why = why_without_effect(flag); !why.empty())
      throw UserError(fmt::format("{} has no effect: {}; take it out", flag, why));
    if (std::ranges::find(known, flag) == known.end())
      throw UserError(unknown_name_message("flag of Google Benchmark", flag, known));
    if (equals != std::string::npos && value.empty())
      throw UserError(fmt::format("{} has an empty value; give one, or leave it out", flag));
    if (!given.insert(flag).second) throw UserError(fmt::format("{} is given twice; keep one", flag));
    if (flag == "--benchmark_repetitions")
      flags.repetitions = number<unsigned>(flag, value, 1, kMaxRepetitions);
    else if (flag == "--benchmark_min_time")
      flags.min_time = number<double>(flag, value, 0.0, 3600.0);
    else if (flag == "--benchmark_min_warmup_time")
      flags.min_warmup_time = number<double>(flag, value, 0.0, 3600.0);
    else if (flag == "--benchmark_filter")
      read_filter(flags, value);
    else if (flag == "--benchmark_out")
      flags.out = value;
    else if (flag == "--benchmark_out_format")
      flags.out_format = one_of(flag, value, {"json", "csv"});
    else if (flag == "--benchmark_format")
      flags.format = one_of(flag, value, {"console", "json", "csv"});
    else if (flag == "--benchmark_time_unit")
      flags.time_unit = one_of(flag, value, {"ns", "us", "ms", "s"});
    else if (flag == "--benchmark_context")
      flags.context = pairs(flag, value);
    else if (flag == "--benchmark_list_tests")
      flags.list = truth(flag, value);
    else if (flag == "--benchmark_report_aggregates_only")
      flags.report_aggregates_only = truth(flag, value);
    else if (flag == "--benchmark_display_aggregates_only")
      flags.display_aggregates_only = truth(flag, value);
    else
      flags.others.push_back(fmt::format("{}={}", flag, truth(flag, value)));
  }
  refuse_lonely(flags, given.contains("--benchmark_out_format"));
  words = std::move(rest);
  return flags;
}

}  // namespace arboretum
