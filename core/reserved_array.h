// ReservedArray: an array with room for the worst case, of which only the part in use is counted and takes memory.
//
// The system gives a page when it is first written, so address space for many elements costs nothing until they are
// used. A builder reserves for the worst case, says how many elements it has handed out, and the MemoryMeter counts
// those; what it needs no more it may give back in parts.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstring>
#include <type_traits>
#include <utility>

#include "core/memory_meter.h"

namespace arboretum {

/// Uninitialised elements of a trivial type. resize() is a vector's: all elements count. reserve() then hand_out() is
/// for callers that do not know how many they will need.
template <class T>
class ReservedArray {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T> && alignof(T) <= 64);

 public:
  ReservedArray() = default;
  ReservedArray(const ReservedArray&) = delete;
  ReservedArray& operator=(const ReservedArray&) = delete;
  ReservedArray(ReservedArray&& other) noexcept { swap(other); }
  ReservedArray& operator=(ReservedArray&& other) noexcept {
    swap(other);
    return *this;
  }
  ~ReservedArray() { clear(); }

  /// Drops what there was; room for `n` elements, none of them counted.
  void reserve(std::size_t n) {
    clear();
    if (n > 0) data_ = static_cast<T*>(allocate_uncounted(n * sizeof(T)));
    size_ = n;
  }
  /// Counts `n` more elements, size() at most in all. Thread-safe.
  void hand_out(std::size_t n) noexcept {
    counted_bytes_.fetch_add(n * sizeof(T), std::memory_order_relaxed);
    MemoryMeter::add(n * sizeof(T));
  }
  /// Gives up the elements, which count on, to whoever calls release_metered() with the bytes of those that count.
  [[nodiscard]] T* release() noexcept {
    counted_bytes_ = 0, size_ = 0;
    return std::exchange(data_, nullptr);
  }
  /// The elements [begin, end), which were handed out, are needed no more: their whole pages go back to the system and
  /// count no longer. Thread-safe for ranges that do not overlap.
  void give_back(std::size_t begin, std::size_t end) noexcept {
    const std::size_t bytes = give_back_pages(data_ + begin, data_ + end);
    counted_bytes_.fetch_sub(bytes, std::memory_order_relaxed);
    MemoryMeter::remove(bytes);
  }
  /// `n` elements, all counted; the first ones keep their values.
  void resize(std::size_t n) {
    ReservedArray to;
    to.reserve(n), to.hand_out(n);
    if (const std::size_t kept = std::min(n, size_); kept > 0)
      std::memcpy(static_cast<void*>(to.data_), data_, kept * sizeof(T));
    swap(to);
  }
  void clear() noexcept {
    if (data_) release_uncounted(data_);
    MemoryMeter::remove(counted_bytes_.exchange(0));
    data_ = nullptr, size_ = 0;
  }
  void swap(ReservedArray& other) noexcept {
    std::swap(data_, other.data_), std::swap(size_, other.size_);
    counted_bytes_ = other.counted_bytes_.exchange(counted_bytes_.load());
  }

  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// How many count: were handed out and not given back.
  [[nodiscard]] std::size_t counted() const noexcept { return counted_bytes_ / sizeof(T); }
  [[nodiscard]] bool empty() const noexcept { return size_ == 0; }
  [[nodiscard]] T* data() noexcept { return data_; }
  [[nodiscard]] const T* data() const noexcept { return data_; }
  [[nodiscard]] T& operator[](std::size_t i) noexcept { return data_[i]; }
  [[nodiscard]] const T& operator[](std::size_t i) const noexcept { return data_[i]; }
  [[nodiscard]] T* begin() noexcept { return data_; }
  [[nodiscard]] T* end() noexcept { return data_ + size_; }
  [[nodiscard]] const T* begin() const noexcept { return data_; }
  [[nodiscard]] const T* end() const noexcept { return data_ + size_; }

 private:
  T* data_ = nullptr;
  std::size_t size_ = 0;
  std::atomic<std::size_t> counted_bytes_{0};
};

}  // namespace arboretum
