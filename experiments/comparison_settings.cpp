#include "experiments/comparison_settings.h"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <optional>

namespace arboretum {
namespace {

YAML::Node load(const std::filesystem::path& folder) {
  try {
    return YAML::LoadFile((folder / "effective.yaml").string());
  } catch (const YAML::Exception&) {  // results.json alone, or a damaged file: then nothing is known
    return {};
  }
}

/// nullopt for what is neither a value nor a list of values.
std::optional<std::string> text_of(const YAML::Node& node) {
  if (node.IsScalar()) return node.Scalar();
  if (!node.IsSequence()) return std::nullopt;
  std::vector<std::string> values;
  for (const YAML::Node& value : node) {
    if (!value.IsScalar()) return std::nullopt;
    values.push_back(value.Scalar());
  }
  return fmt::format("[{}]", fmt::join(values, ", "));
}

void compare_values(const std::string& name, const YAML::Node& a, const YAML::Node& b,
                    std::vector<SettingDifference>& out) {
  const auto of_a = text_of(a), of_b = text_of(b);
  if (of_a && of_b && *of_a != *of_b) out.push_back({name, *of_a, *of_b});
}

}  // namespace

std::vector<SettingDifference> setting_differences(const std::filesystem::path& a, const std::filesystem::path& b) {
  std::vector<SettingDifference> differences;
  const YAML::Node of_a = load(a), of_b = load(b);
  if (!of_a.IsMap() || !of_b.IsMap()) return differences;
  for (const std::string group : {"axes", "parameters", "rays", "measure", "metrics"}) {
    const YAML::Node in_a = of_a[group], in_b = of_b[group];
    if (!in_a || !in_b) continue;
    if (!in_a.IsMap() || !in_b.IsMap()) {
      compare_values(group, in_a, in_b, differences);
      continue;
    }
    for (const auto& entry : in_a) {
      const std::string key = entry.first.Scalar();
      if (const YAML::Node other = in_b[key]; other && key != "structure_cache")
        compare_values(group + ": " + key, entry.second, other, differences);
    }
  }
  return differences;
}

}  // namespace arboretum
