// --filter and --skip: which names are meant.
#pragma once

#include <optional>
#include <regex>
#include <string>

namespace arboretum {

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
