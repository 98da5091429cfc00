#include "core/error.h"

#include <cstdio>
#include <string_view>

#include "core/utf8.h"

namespace arboretum {
namespace {

bool is_control(char c) { return static_cast<unsigned char>(c) < ' ' || c == 127; }

std::string escaped(char c) {
  if (c == '\n') return "\\n";
  if (c == '\t') return "\\t";
  char text[8];
  std::snprintf(text, sizeof text, "\\x%02x", unsigned(static_cast<unsigned char>(c)));
  return text;
}

/// What was wrong stands at the beginning, the mend at the end.
std::string without_middle(const std::string& text) {
  constexpr std::string_view kGap = " ... ";
  std::size_t head = UserError::kLongest / 2, tail = text.size() - (UserError::kLongest - head - kGap.size());
  while (head > 0 && continues_character(text[head])) --head;
  while (tail < text.size() && continues_character(text[tail])) ++tail;
  return text.substr(0, head) + std::string(kGap) + text.substr(tail);
}

/// Controls escaped, and no longer than kLongest.
std::string shown(const std::string& message) {
  std::string line;
  line.reserve(message.size());
  for (const char c : message) {
    if (is_control(c)) {
      line += escaped(c);
    } else {
      line += c;
    }
  }
  return line.size() > UserError::kLongest ? without_middle(line) : line;
}

}  // namespace

UserError::UserError(const std::string& message) : std::runtime_error(shown(message)) {}

}  // namespace arboretum
