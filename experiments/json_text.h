// JSON to text and from it: whatever bytes it holds, and syntax errors in one line.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

namespace arboretum {

/// A line, or with `indent` as many blanks a level. Command lines and names of files may be any bytes: those that are
/// no part of UTF-8 become U+FFFD.
[[nodiscard]] std::string to_text(const nlohmann::ordered_json& json, int indent = -1);
[[nodiscard]] std::string to_text(const nlohmann::json& json, int indent = -1);
/// Throws UserError: file and line, what was found and what is expected there, and the mend.
[[noreturn]] void fail_syntax(const std::filesystem::path& file, std::string_view text,
                              const nlohmann::json::parse_error& error, std::string_view mend);

}  // namespace arboretum
