// A number out of a word, whatever the locale.
#pragma once

#include <charconv>
#include <optional>
#include <string_view>
#include <system_error>

namespace arboretum {

/// The number that all of `text` is; nothing where there is none, more than one, or one beyond T. No blanks, no `+`, no
/// `0x`; an unsigned T takes no `-`, a floating-point one takes `nan` and `inf`.
template <class T>
[[nodiscard]] std::optional<T> parse_number(std::string_view text) noexcept {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace arboretum
