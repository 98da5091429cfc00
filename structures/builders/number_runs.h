// NumberRuns: consecutive numbers for tasks that take them at the same time.
#pragma once

#include <atomic>
#include <cstdint>
#include <utility>

namespace arboretum {

/// Gives out numbers from `first` on in runs, so that tasks seldom meet at the counter and the numbers of one lie
/// together. Which task has which depends on scheduling.
class NumberRuns {
 public:
  /// What is left of a run, [next, end): of one task, or of tasks that never run at the same time. Alone in its line of
  /// memory.
  struct alignas(64) Share {
    std::uint32_t next = 0, end = 0;
    [[nodiscard]] bool is_new() const noexcept { return end == 0; }
    [[nodiscard]] std::uint32_t left() const noexcept { return end - next; }
  };

  NumberRuns(std::uint32_t first, std::uint32_t run) noexcept : run_(run), next_(first) {}

  /// The first of `n` consecutive numbers, a run's at most. Where the share has fewer they are lost, and `begins` is
  /// called before a new run.
  template <class Begins>
  [[nodiscard]] std::uint32_t take(std::uint32_t n, Share& share, const Begins& begins) noexcept {
    if (share.left() < n) {
      begins();
      share.next = next_.fetch_add(run_, std::memory_order_relaxed), share.end = share.next + run_;
    }
    return std::exchange(share.next, share.next + n);
  }

  /// Numbers below this were given out, or are in a share.
  [[nodiscard]] std::uint32_t end() const noexcept { return next_.load(std::memory_order_relaxed); }

 private:
  const std::uint32_t run_;
  std::atomic<std::uint32_t> next_;
};

}  // namespace arboretum
