#include "experiments/yaml_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>
#include <set>
#include <system_error>

#include "core/error.h"
#include "core/names.h"
#include "core/parse_number.h"
#include "core/whole_file.h"
#include "scenes/yaml_node.h"

namespace arboretum {
namespace {

/// Throws UserError with the mends that a configuration has.
std::string read_configuration(const std::filesystem::path& file) {
  std::error_code ignored;
  const std::filesystem::file_type type = std::filesystem::status(file, ignored).type();
  if (type == std::filesystem::file_type::not_found)
    throw UserError(fmt::format("{}: no such file; name a configuration, as in configs/quick.yaml", file.string()));
  if (type == std::filesystem::file_type::directory)
    throw UserError(fmt::format("{}: is a folder; name the YAML file in it", file.string()));
  return read_whole(file);
}

/// For a message of one line: a file that is no YAML may be one scalar from end to end.
std::string shown(const YAML::Node& node) {
  constexpr std::size_t kMostShown = 60;
  if (node.IsScalar()) return fmt::format("'{}'", shortened(node.Scalar(), kMostShown));
  return node.IsSequence() ? "a list" : node.IsMap() ? "a map" : "nothing";
}

/// The same text for the same number: 1, 1.0 and 1e0 are one value.
std::string one_spelling(const std::string& word) {
  const std::optional<double> number = parse_number<double>(word);
  return number ? fmt::format("{}", *number) : word;
}

}  // namespace

YamlReader::YamlReader(std::filesystem::path file) : file_(std::move(file)) {
  root_ = read_document(read_configuration(file_), file_, "a configuration");
  if (!root_ || root_.IsNull())
    throw UserError(fmt::format("{}: empty; a configuration has at least `scenes`", file_.string()));
}

std::string YamlReader::where(const YAML::Node& node) const {
  const int line = node.Mark().line;
  return line < 0 ? file_.string() : fmt::format("{}:{}", file_.string(), line + 1);
}

void YamlReader::fail(const YAML::Node& node, const std::string& message) const {
  throw UserError(where(node) + ": " + message);
}

void YamlReader::check_map(const YAML::Node& node, std::string_view what, std::span<const std::string> keys) const {
  if (!node.IsMap())
    fail(node, fmt::format("{} must be a map of {}, not {}", what, fmt::join(keys, ", "), shown(node)));
  std::set<std::string> seen;
  for (const auto& entry : node) {
    if (!entry.first.IsScalar())
      fail(entry.first, fmt::format("{}: a key must be a word, not {}", what, shown(entry.first)));
    const std::string key = entry.first.Scalar();
    if (key == "<<")
      fail(entry.first, fmt::format("{}: merge keys (<<) are not read; write out the keys that it stands for", what));
    if (std::ranges::find(keys, key) == keys.end())
      fail(entry.first, unknown_name_message(fmt::format("key in {}", what), key, keys));
    if (!seen.insert(key).second) fail(entry.first, fmt::format("{}: '{}' is given twice; keep one", what, key));
    if (entry.second.IsNull()) fail(entry.first, fmt::format("'{}' has no value; give one or take the line out", key));
  }
}

std::string YamlReader::text(const YAML::Node& node, std::string_view what) const {
  if (!node.IsScalar() || node.Scalar().empty())
    fail(node, fmt::format("{} must be a word, not {}", what, shown(node)));
  return node.Scalar();
}

std::uint64_t YamlReader::integer(const YAML::Node& node, std::string_view what, std::uint64_t low,
                                  std::uint64_t high) const {
  const auto value = parse_number<std::uint64_t>(node.IsScalar() ? node.Scalar() : "");
  if (!value || *value < low || *value > high)
    fail(node, fmt::format("{} must be an integer from {} to {}, not {}", what, low, high, shown(node)));
  return *value;
}

double YamlReader::number(const YAML::Node& node, std::string_view what, double low, double high) const {
  const auto value = parse_number<double>(node.IsScalar() ? node.Scalar() : "");
  if (!value || !(*value >= low && *value <= high))
    fail(node, fmt::format("{} must be a number from {} to {}, not {}", what, low, high, shown(node)));
  return *value;
}

std::vector<YAML::Node> YamlReader::list(const YAML::Node& node, std::string_view what) const {
  std::vector<YAML::Node> values;
  if (node.IsScalar()) {
    values.push_back(node);
  } else if (node.IsSequence()) {
    for (const YAML::Node& value : node) values.push_back(value);
  } else {
    fail(node, fmt::format("{} must be a list, not {}", what, shown(node)));
  }
  if (values.empty()) fail(node, fmt::format("{} is empty; name at least one value or take the line out", what));
  std::set<std::string> seen;
  for (const YAML::Node& value : values) {
    if (!value.IsScalar() || value.Scalar().empty())
      fail(value, fmt::format("{}: a value must be a word, not {}", what, shown(value)));
    if (!seen.insert(one_spelling(value.Scalar())).second)
      fail(value, fmt::format("{}: '{}' is given twice; keep one", what, value.Scalar()));
  }
  return values;
}

std::size_t YamlReader::bytes(const YAML::Node& node, std::string_view what) const {
  constexpr std::pair<std::string_view, int> kUnits[] = {{"", 0},     {"B", 0},    {"KiB", 10},
                                                         {"MiB", 20}, {"GiB", 30}, {"TiB", 40}};
  constexpr double kLeast = 0x1p20;  // less is a unit forgotten
  const std::string s = node.IsScalar() ? node.Scalar() : "";
  double value = 0;
  const auto [end, error] = std::from_chars(s.data(), s.data() + s.size(), value);
  std::string_view unit(end, static_cast<std::size_t>(s.data() + s.size() - end));
  while (unit.starts_with(' ')) unit.remove_prefix(1);
  for (const auto& [name, shift] : kUnits) {
    if (s.empty() || error != std::errc{} || unit != name) continue;
    const double total = value * static_cast<double>(std::size_t{1} << shift);
    if (total >= 0x1p60) fail(node, fmt::format("{} must be a size below 1048576TiB, not {}", what, s));
    if (total >= kLeast) return static_cast<std::size_t>(total);
  }
  fail(node, fmt::format("{} must be a size of 1MiB and more, such as 8GiB or 512MiB, not {}", what, shown(node)));
}

}  // namespace arboretum
