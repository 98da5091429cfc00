// Counter-based random numbers: the value depends on (seed, index, dimension) alone, so rays are the same in any order
// and on any number of threads. Mixing: the finaliser of SplitMix64 (Steele, Lea, Flood 2014), applied twice.
#pragma once

#include <cstdint>

namespace arboretum {

[[nodiscard]] constexpr std::uint64_t mix64(std::uint64_t x) noexcept {
  x += 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

/// 64 random bits of sample `index` in `dimension`.
[[nodiscard]] constexpr std::uint64_t random_bits(std::uint64_t seed, std::uint64_t index,
                                                  std::uint64_t dimension) noexcept {
  return mix64(mix64(seed ^ (dimension * 0xd1342543de82ef95u)) ^ mix64(index));
}

/// Uniform in [0, 1), a multiple of 2^-24.
[[nodiscard]] constexpr float random_float(std::uint64_t seed, std::uint64_t index, std::uint64_t dimension) noexcept {
  return float(random_bits(seed, index, dimension) >> 40) * 0x1p-24f;
}

/// Uniform in [0, 1), a multiple of 2^-53.
[[nodiscard]] constexpr double random_double(std::uint64_t seed, std::uint64_t index,
                                             std::uint64_t dimension) noexcept {
  return double(random_bits(seed, index, dimension) >> 11) * 0x1p-53;
}

}  // namespace arboretum
