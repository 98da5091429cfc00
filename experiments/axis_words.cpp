#include "experiments/axis_words.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <set>

#include "core/error.h"
#include "core/names.h"
#include "core/parse_number.h"

namespace arboretum {

std::string check_axis_value(Axis axis, std::string& value, const Registry& registry) {
  if (axis == Axis::threads) {
    const std::optional<unsigned> n = parse_number<unsigned>(value);
    if (!n || *n < 1 || *n > kMaxThreads)
      return fmt::format("threads must be an integer from 1 to {}, not '{}'", kMaxThreads, value);
    value = std::to_string(*n);
    return {};
  }
  if (axis == Axis::isa) {
    if (const auto isa = parse_isa(value)) return value = to_string(*isa), std::string();
  }
  const std::vector<std::string> known = known_values(axis, registry);
  if (std::ranges::find(known, value) != known.end()) return {};
  return unknown_name_message(to_string(axis), value, known);
}

void refuse_repeated_axes(const std::vector<std::string>& words) {
  std::set<std::string> seen;
  for (const std::string& word : words) {
    const std::string key = word.substr(0, word.find('='));
    if (!seen.insert(key).second)
      throw UserError(
          fmt::format("command line: {} is given twice; name its values together, as in {}=value,value", key, key));
  }
}

AxisWord read_axis_word(const std::string& word, const Registry& registry, const std::vector<std::string>& further) {
  const std::size_t equals = word.find('=');
  if (equals == std::string::npos) {
    throw UserError(fmt::format("command line: '{}' is no axis=value,value; for example isa=avx2,avx512", word));
  }
  const std::string key = word.substr(0, equals);
  std::vector<std::string> names{kAxisNames.begin(), kAxisNames.end()};
  names.insert(names.end(), further.begin(), further.end());
  if (std::ranges::find(names, key) == names.end())
    throw UserError(fmt::format("command line: {}", unknown_name_message("axis", key, names)));
  std::vector<std::string> values;
  for (std::size_t begin = equals + 1; begin <= word.size();) {
    const std::size_t comma = std::min(word.find(',', begin), word.size());
    std::string value = word.substr(begin, comma - begin);
    begin = comma + 1;
    if (value.empty())
      throw UserError(fmt::format("command line: '{}' holds an empty value; give {}=value,value", word, key));
    if (const auto axis = parse_axis(key)) {
      if (const std::string wrong = check_axis_value(*axis, value, registry); !wrong.empty())
        throw UserError(fmt::format("command line: {}", wrong));
    }
    if (std::ranges::find(values, value) != values.end())
      throw UserError(fmt::format("command line: {}: '{}' is given twice; keep one", key, value));
    values.push_back(value);
  }
  return {key, values};
}

}  // namespace arboretum
