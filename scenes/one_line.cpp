// Words of others, fit for one line: bytes of broken files are not UTF-8, and what is printed may end up in JSON.
#include "core/utf8.h"
#include "scenes/readers.h"

namespace arboretum {
namespace {

/// Bytes of the character that `text` begins with, as RFC 3629 has it: none too long, no surrogate, nothing beyond
/// U+10FFFF. 0 where there is none.
std::size_t character_length(std::string_view text) {
  const auto byte = [&](std::size_t i) { return i < text.size() ? unsigned(static_cast<unsigned char>(text[i])) : 0u; };
  const unsigned lead = byte(0), next = byte(1);
  const std::size_t length = lead < 0x80   ? 1
                             : lead < 0xc2 ? 0
                             : lead < 0xe0 ? 2
                             : lead < 0xf0 ? 3
                             : lead < 0xf5 ? 4
                                           : 0;
  for (std::size_t i = 1; i < length; ++i)
    if (i >= text.size() || !continues_character(text[i])) return 0;
  const bool is_too_long = (lead == 0xe0 && next < 0xa0) || (lead == 0xf0 && next < 0x90);
  const bool is_beyond = (lead == 0xed && next >= 0xa0) || (lead == 0xf4 && next >= 0x90);
  return is_too_long || is_beyond ? 0 : length;
}

/// ASCII's and the 32 of Latin-1.
bool is_control(std::string_view character) {
  const auto lead = static_cast<unsigned char>(character[0]);
  return lead < ' ' || lead == 127 || (lead == 0xc2 && static_cast<unsigned char>(character[1]) < 0xa0);
}

}  // namespace

std::string one_line(std::string_view text) {
  constexpr std::size_t kLongest = 300;
  std::string line;
  while (!text.empty()) {
    const std::size_t length = character_length(text);
    std::string_view character = length == 0 ? "?" : text.substr(0, length);
    text.remove_prefix(std::max<std::size_t>(length, 1));
    if (character == " " || is_control(character)) {
      if (line.empty() || line.back() == ' ') continue;
      character = " ";
    }
    if (line.size() + character.size() > kLongest) return line + "...";
    line += character;
  }
  while (!line.empty() && line.back() == ' ') line.pop_back();
  return line;
}

}  // namespace arboretum
