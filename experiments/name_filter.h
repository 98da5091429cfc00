// --filter and --skip: which names are meant.
#pragma once

#include <optional>
#include <regex>
#include <string>
#include <string_view>

namespace arboretum {

/// An ECMAScript regular expression without references to groups, found in a time that grows no faster than a power of
/// its length. Throws UserError, which names `option`, for a broken or overlong one.
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
