#include "experiments/shell_words.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <optional>

namespace arboretum {

std::string shell_word(std::string_view word) {
  const auto plain = [](unsigned char c) {
    return std::isalnum(c) || c >= 0x80 || std::string_view("_@%+=:,./-").find(char(c)) != std::string_view::npos;
  };
  if (!word.empty() && std::ranges::all_of(word, plain)) return std::string(word);
  std::string quoted = "'";
  for (char c : word) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + "'";
}

std::string shell_line(std::span<const std::string> words) {
  std::vector<std::string> typed;
  for (const std::string& word : words) typed.push_back(shell_word(word));
  return fmt::format("{}", fmt::join(typed, " "));
}

std::vector<std::string> shell_split(std::string_view line) {
  std::vector<std::string> words;
  std::optional<std::string> word;
  bool quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (c == ' ' && !quoted) {
      if (word) words.push_back(*word);
      word.reset();
      continue;
    }
    if (!word) word.emplace();
    if (c == '\'')
      quoted = !quoted;
    else
      *word += c == '\\' && !quoted && i + 1 < line.size() ? line[++i] : c;
  }
  if (word) words.push_back(*word);
  return words;
}

}  // namespace arboretum
