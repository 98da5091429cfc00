// Bytes of leaf blocks that hold nothing. They are written like the others: the same build then gives the same bytes,
// in memory and in saved files.
#pragma once

#include <cstddef>
#include <cstring>

namespace arboretum {

/// Bytes behind a block's last member: of some blocks of one triangle there are four.
template <class Block>
inline constexpr std::size_t kBlockPadding = sizeof(Block) - offsetof(Block, id) - sizeof(Block::id);

/// Zeroes what fill_blocks() leaves of `count` blocks.
template <class Block>
void clear_padding(Block* blocks, std::size_t count) noexcept {
  constexpr std::size_t kBytes = kBlockPadding<Block>;
  if constexpr (kBytes > 0) {
    for (std::size_t i = 0; i < count; ++i)
      std::memset(reinterpret_cast<std::byte*>(blocks + i + 1) - kBytes, 0, kBytes);
  }
}

}  // namespace arboretum
