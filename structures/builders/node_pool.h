// NodePool: node indices for builders whose tasks make nodes at the same time.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>

namespace arboretum {

/// Gives out pairs of neighbouring indices from 1 on (0 is the root). Each task owns a Share and takes indices in blocks, so that
/// its nodes lie together; numbers depend on scheduling, the tree need not.
class NodePool {
 public:
  static constexpr std::uint32_t kBlock = 256;

  struct Share {
    std::uint32_t next = 0, end = 0;
  };

  /// Indices that a tree of n references may need, when a task is started only for subtrees of more than `grain` of them.
  [[nodiscard]] static std::size_t capacity(std::size_t n, std::size_t grain) noexcept { return 2 * n + (n / grain + 2) * kBlock; }

  /// The first of two.
  [[nodiscard]] std::uint32_t take_pair(Share& share) noexcept {
    if (share.next + 2 > share.end) {
      share.next = next_.fetch_add(kBlock, std::memory_order_relaxed);
      share.end = share.next + kBlock;
    }
    share.next += 2;
    return share.next - 2;
  }

  /// All indices given out are below it.
  [[nodiscard]] std::uint32_t used() const noexcept { return next_.load(std::memory_order_relaxed); }

 private:
  std::atomic<std::uint32_t> next_{1};
};

}  // namespace arboretum
