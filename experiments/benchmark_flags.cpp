#include "experiments/benchmark_flags.h"

#include <fmt/format.h>

#include <charconv>

#include "core/error.h"

namespace arboretum {
namespace {

template <class T>
T number(const std::string& flag, std::string text, T low, T high) {
  if (text.ends_with('s')) text.pop_back();  // newer releases write 0.5s
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size() || !(value >= low && value <= high)) {
    throw UserError(fmt::format("{}: a number from {} to {}, not '{}'", flag, low, high, text));
  }
  return value;
}

std::string one_of(const std::string& flag, const std::string& value,
                   std::initializer_list<std::string_view> allowed) {
  for (std::string_view a : allowed)
    if (a == value) return value;
  throw UserError(fmt::format("{}: one of {}, not '{}'", flag, fmt::join(allowed, ", "), value));
}

}  // namespace

BenchmarkFlags take_benchmark_flags(std::vector<std::string>& words) {
  BenchmarkFlags flags;
  std::vector<std::string> rest;
  for (const std::string& word : words) {
    if (!word.starts_with("--benchmark_")) {
      rest.push_back(word);
      continue;
    }
    const std::size_t equals = word.find('=');
    const std::string flag = word.substr(0, equals);
    const std::string value = equals == std::string::npos ? "" : word.substr(equals + 1);
    if (flag == "--benchmark_repetitions")
      flags.repetitions = number<unsigned>(flag, value, 1, 100000);
    else if (flag == "--benchmark_min_time")
      flags.min_time = number<double>(flag, value, 0.0, 3600.0);
    else if (flag == "--benchmark_filter")
      flags.filter = value;
    else if (flag == "--benchmark_out")
      flags.out = value;
    else if (flag == "--benchmark_out_format")
      flags.out_format = one_of(flag, value, {"json", "csv"});
    else if (flag == "--benchmark_format")
      flags.format = one_of(flag, value, {"console", "json", "csv"});
    else if (flag == "--benchmark_list_tests")
      flags.list = one_of(flag, value.empty() ? "true" : value, {"true", "false"}) == "true";
    else
      flags.others.push_back(word);
  }
  words = std::move(rest);
  return flags;
}

}  // namespace arboretum
