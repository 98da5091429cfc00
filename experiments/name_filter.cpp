#include "experiments/name_filter.h"

#include <fmt/format.h>

#include "core/error.h"

namespace arboretum {
namespace {

std::regex compile(const std::string& expression, std::string_view option) {
  try {
    return std::regex(expression);
  } catch (const std::regex_error&) {
    throw UserError(fmt::format("{} '{}' is no regular expression (ECMAScript syntax); check brackets and backslashes",
                                option, expression));
  }
}

}  // namespace

NameFilter::NameFilter(const std::string& filter, const std::string& skip) {
  if (!filter.empty()) filter_ = compile(filter, "--filter");
  if (!skip.empty()) skip_ = compile(skip, "--skip");
}

bool NameFilter::operator()(const std::string& name) const {
  return !(filter_ && !std::regex_search(name, *filter_)) && !(skip_ && std::regex_search(name, *skip_));
}

}  // namespace arboretum
