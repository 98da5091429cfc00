// --filter and --skip: which names are meant.
#pragma once

#include <optional>
#include <regex>
#include <string>
#include <string_view>

namespace arboretum {

/// An ECMAScript regular expression of 2000 characters at most, without references to groups, that looks ahead twice at
/// most: found without backtracking. Throws UserError, which names `option`, for any other.
[[nodiscard]] std::regex name_expression(const std::string& expression, std::string_view option);

/// Names that `filter` finds and `skip` does not (ECMAScript regular expressions; empty: all, none).
class NameFilter {
 public:
  /// Throws UserError for a broken expression.
  NameFilter(const std::string& filter, const std::string& skip);
  [[nodiscard]] bool operator()(const std::string& name) const;

 private:
  std::optional<std::regex> filter_, skip_;
};

}  // namespace arboretum
