// Morton codes: the bits of three coordinates interleaved.
#pragma once

#include <cstdint>

namespace arboretum {

/// Bit i goes to bit 3 i; 21 bits at most.
[[nodiscard]] constexpr std::uint64_t spread_bits(std::uint32_t x) noexcept {
  std::uint64_t v = x;
  v = (v | v << 32) & 0x001f00000000ffff;
  v = (v | v << 16) & 0x001f0000ff0000ff;
  v = (v | v << 8) & 0x100f00f00f00f00f;
  v = (v | v << 4) & 0x10c30c30c30c30c3;
  v = (v | v << 2) & 0x1249249249249249;
  return v;
}

/// x in the highest bit of each three; 21 bits a coordinate at most.
[[nodiscard]] constexpr std::uint64_t morton_code(std::uint32_t x, std::uint32_t y, std::uint32_t z) noexcept {
  return spread_bits(x) << 2 | spread_bits(y) << 1 | spread_bits(z);
}

}  // namespace arboretum
