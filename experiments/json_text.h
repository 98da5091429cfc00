// Syntax errors of JSON files, in one line.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

#include <nlohmann/json.hpp>

namespace arboretum {

[[nodiscard]] std::string read_text(const std::filesystem::path& file);
/// Throws UserError: file and line, what was found and what is expected there, and the mend.
[[noreturn]] void fail_syntax(const std::filesystem::path& file, std::string_view text,
                              const nlohmann::json::parse_error& error, std::string_view mend);

}  // namespace arboretum
