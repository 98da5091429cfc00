#include "core/names.h"

#include <algorithm>
#include <vector>

#include "core/error.h"
#include "core/utf8.h"

namespace arboretum {
namespace {

/// No name of ours is nearly as long, nor near to one that is.
constexpr std::size_t kLongestName = 100;

}  // namespace

std::string in_lower_case(std::string_view text) {
  std::string low(text);
  for (char& c : low)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c + ('a' - 'A'));
  return low;
}

std::string shortened(std::string_view text, std::size_t most) {
  if (text.size() <= most) return std::string(text);
  std::size_t end = most;
  while (end > 0 && continues_character(text[end])) --end;
  const auto characters = text.size() - static_cast<std::size_t>(std::ranges::count_if(text, continues_character));
  return std::string(text.substr(0, end)) + "... (" + std::to_string(characters) + " characters)";
}

std::size_t edit_distance(std::string_view left, std::string_view right) {
  const std::string a = in_lower_case(left), b = in_lower_case(right);
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  for (std::size_t j = 0; j <= b.size(); ++j) d[0][j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    for (std::size_t j = 1; j <= b.size(); ++j) {
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] != b[j - 1])});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[a.size()][b.size()];
}

std::string nearest_name(std::string_view name, std::span<const std::string> candidates) {
  std::string best;
  std::size_t best_distance = ~std::size_t{0};
  for (const std::string& candidate : candidates) {
    if (const std::size_t distance = edit_distance(name, candidate); distance < best_distance) {
      best_distance = distance, best = candidate;
    }
  }
  return best;
}

std::string close_name(std::string_view name, std::span<const std::string> candidates) {
  const std::string nearest = nearest_name(name, candidates);
  const bool same_start = name.size() >= 3 && in_lower_case(nearest).starts_with(in_lower_case(name.substr(0, 3)));
  return same_start || 3 * edit_distance(name, nearest) <= std::max(name.size(), nearest.size()) ? nearest : "";
}

std::string unknown_name_message(std::string_view kind, std::string_view name,
                                 std::span<const std::string> candidates) {
  std::string message = "unknown " + std::string(kind) + " '" + shortened(name, kLongestName) + "'";
  name = name.substr(0, kLongestName);
  if (candidates.empty()) return message;
  const std::string close = close_name(name, candidates);
  message += close.empty() ? " (valid:" : "; did you mean '" + close + "'? (valid:";
  for (const std::string& candidate : candidates) message += " " + candidate;
  return message + ")";
}

std::size_t index_of_name(std::string_view kind, std::string_view name, std::span<const std::string_view> names) {
  const auto found = std::ranges::find(names, name);
  if (found == names.end())
    throw UserError(unknown_name_message(kind, name, std::vector<std::string>(names.begin(), names.end())));
  return std::size_t(found - names.begin());
}

}  // namespace arboretum
