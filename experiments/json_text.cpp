#include "experiments/json_text.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/error.h"

namespace arboretum {
namespace {

template <class AnyJson>
std::string text_of(const AnyJson& json, int indent) {
  return json.dump(indent, ' ', false, AnyJson::error_handler_t::replace);
}

}  // namespace

std::string to_text(const nlohmann::ordered_json& json, int indent) { return text_of(json, indent); }
std::string to_text(const nlohmann::json& json, int indent) { return text_of(json, indent); }

void fail_syntax(const std::filesystem::path& file, std::string_view text, const nlohmann::json::parse_error& error,
                 std::string_view mend) {
  const std::string_view before = text.substr(0, error.byte > 0 ? error.byte - 1 : 0);
  // "[json.exception.parse_error.101] parse error at line 1, column 2: syntax error while parsing value - invalid
  // literal; last read: 'x'; expected …": what follows the dash is for people
  std::string_view what = error.what();
  if (const std::size_t dash = what.find(" - "); dash != std::string_view::npos)
    what.remove_prefix(dash + 3);
  else if (const std::size_t colon = what.find(": "); colon != std::string_view::npos)
    what.remove_prefix(colon + 2);
  throw UserError(
      fmt::format("{}:{}: no JSON: {}; {}", file.string(), 1 + std::ranges::count(before, '\n'), what, mend));
}

}  // namespace arboretum
