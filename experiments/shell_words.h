// Command lines as a shell reads them.
#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace arboretum {

/// The word as it is typed: in single quotes where a shell would make something else of it.
[[nodiscard]] std::string shell_word(std::string_view word);
/// The words, each as it is typed.
[[nodiscard]] std::string shell_line(std::span<const std::string> words);
/// The words of what shell_line() made. Of quotes it knows what that writes, single ones and the backslash.
[[nodiscard]] std::vector<std::string> shell_split(std::string_view line);

}  // namespace arboretum
