// Axis words of the command line: `isa=avx2,avx512`.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "core/error.h"
#include "experiments/axes.h"

namespace arboretum {

/// Most threads that a cell may have.
inline constexpr unsigned kMaxThreads = 4096;

struct AxisWord {
  std::string key;
  std::vector<std::string> values;
};

/// Checks one value of an axis and brings it to its one spelling. Returns why not, or empty.
[[nodiscard]] std::string check_axis_value(Axis axis, std::string& value, const Registry& registry);
/// Throws UserError for a word that is no axis=value,value, an unknown axis or value and a value given twice. `further`
/// names keys beside the axes, whose values are taken as they are.
[[nodiscard]] AxisWord read_axis_word(const std::string& word, const Registry& registry,
                                      const std::vector<std::string>& further);
/// Throws UserError where a value of an option's list is there twice.
template <class T>
void refuse_doubled(std::string_view option, const std::vector<T>& values) {
  for (auto value = values.begin(); value != values.end(); ++value)
    if (std::find(values.begin(), value, *value) != value)
      throw UserError(fmt::format("{}: '{}' is given twice; keep one", option, *value));
}
/// Throws UserError where two words are of one axis: the later would silently replace the earlier.
void refuse_repeated_axes(const std::vector<std::string>& words);

}  // namespace arboretum
