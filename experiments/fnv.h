// FNV-1a, 64 bits (Fowler, Noll, Vo): names and configurations told apart, not guarded against anyone.
#pragma once

#include <cstdint>
#include <string_view>

namespace arboretum {

/// `hash`: of what stands before.
[[nodiscard]] constexpr std::uint64_t fnv1a(std::string_view text, std::uint64_t hash = 0xcbf29ce484222325u) noexcept {
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 0x100000001b3u;
  return hash;
}

}  // namespace arboretum
