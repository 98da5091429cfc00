// Lines, words and numbers out of text: correctly rounded floats, `nan` and `inf` included, whatever the locale.
#pragma once

#include <locale.h>
#include <stdlib.h>

#include <algorithm>
#include <charconv>
#include <string>
#include <string_view>

namespace arboretum {

/// Skips blanks (not line ends).
[[nodiscard]] inline const char* skip_blanks(const char* p, const char* end) noexcept {
  while (p != end && (*p == ' ' || *p == '\t')) ++p;
  return p;
}

/// Reads a float at `p`; returns the end of it, or nullptr where there is none. What is too large becomes an
/// infinity, what is too small zero or a subnormal.
[[nodiscard]] inline const char* parse_float(const char* p, const char* end, float& value) {
  if (p != end && *p == '+') ++p;
  const auto [next, error] = std::from_chars(p, end, value);
  if (error == std::errc{}) return next;
  if (error != std::errc::result_out_of_range) return nullptr;
  static const locale_t kC = newlocale(LC_ALL_MASK, "C", nullptr);
  value = strtof_l(std::string(p, next).c_str(), nullptr, kC);
  return next;
}

/// The float that all of `word` is, as above; false where it is none.
[[nodiscard]] inline bool parse_float(std::string_view word, float& value) {
  return !word.empty() && parse_float(word.data(), word.data() + word.size(), value) == word.data() + word.size();
}

/// The next line, taken off the front of the text with its end: "\n", "\r\n" or "\r".
[[nodiscard]] inline std::string_view next_line(std::string_view& text) {
  const std::size_t end = std::min(text.size(), text.find_first_of("\r\n"));
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(std::min(text.size(), end + (text.substr(end).starts_with("\r\n") ? 2 : 1)));
  return line;
}

/// The next word of a line, taken off its front; empty at its end or before a comment.
[[nodiscard]] inline std::string_view next_word(std::string_view& line) {
  line.remove_prefix(std::min(line.size(), line.find_first_not_of(" \t\r")));
  if (line.starts_with('#')) line = {};
  const std::string_view word = line.substr(0, line.find_first_of(" \t\r#"));
  line.remove_prefix(word.size());
  return word;
}

}  // namespace arboretum
