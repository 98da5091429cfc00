// Where characters begin in UTF-8.
#pragma once

namespace arboretum {

/// Not the first byte of a character.
[[nodiscard]] constexpr bool continues_character(char c) noexcept {
  return (static_cast<unsigned char>(c) & 0xc0) == 0x80;
}

}  // namespace arboretum
