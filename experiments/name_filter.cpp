#include "experiments/name_filter.h"

#include <fmt/format.h>

#include "core/error.h"

namespace arboretum {
std::regex name_expression(const std::string& expression, std::string_view option) {
  constexpr std::size_t kMostCharacters = 2000;  // compiling recurses
  if (expression.size() > kMostCharacters)
    throw UserError(fmt::format("{}: an expression of {} characters is too long; {} are possible", option,
                                expression.size(), kMostCharacters));
  // Each begins a search of its own wherever it is met. Two are what --filter and --benchmark_filter become together.
  constexpr int kMostLooksAhead = 2;
  int looks = 0;
  for (const std::string_view ahead : {"(?=", "(?!"})
    for (std::size_t at = 0; (at = expression.find(ahead, at)) != std::string::npos; ++at) ++looks;
  if (looks > kMostLooksAhead)
    throw UserError(fmt::format("{} '{}' looks ahead ('(?=', '(?!') {} times; {} are possible, and --skip leaves out",
                                option, expression, looks, kMostLooksAhead));
  auto syntax = std::regex::ECMAScript;
#ifdef __GLIBCXX__
  syntax |= std::regex_constants::__polynomial;  // else some take for ever
#endif
  try {
    return std::regex(expression, syntax);
  } catch (const std::regex_error&) {
    throw UserError(
        fmt::format("{} '{}' is no regular expression (ECMAScript syntax, without references to groups); "
                    "check brackets and backslashes",
                    option, expression));
  }
}

NameFilter::NameFilter(const std::string& filter, const std::string& skip) {
  if (!filter.empty()) filter_ = name_expression(filter, "--filter");
  if (!skip.empty()) skip_ = name_expression(skip, "--skip");
}

bool NameFilter::operator()(const std::string& name) const {
  return !(filter_ && !std::regex_search(name, *filter_)) && !(skip_ && std::regex_search(name, *skip_));
}

}  // namespace arboretum
