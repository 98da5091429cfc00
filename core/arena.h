// Arena: one aligned, uninitialised block of bytes; what nodes and leaf blocks live in.
#pragma once

#include <cstddef>
#include <utility>

namespace arboretum {

template <class T>
class ReservedArray;

/// Bytes aligned to 64 (2 MiB when larger than that), uninitialised: whoever fills it writes every byte it uses.
class Arena {
 public:
  Arena() = default;
  explicit Arena(std::size_t bytes);
  /// Those of the array that count.
  explicit Arena(ReservedArray<std::byte>&& array) noexcept;
  Arena(Arena&& other) noexcept : data_(std::exchange(other.data_, nullptr)), bytes_(std::exchange(other.bytes_, 0)) {}
  Arena& operator=(Arena&& other) noexcept {
    std::swap(data_, other.data_), std::swap(bytes_, other.bytes_);
    return *this;
  }
  ~Arena();

  [[nodiscard]] std::byte* data() noexcept { return data_; }
  [[nodiscard]] const std::byte* data() const noexcept { return data_; }
  [[nodiscard]] std::size_t bytes() const noexcept { return bytes_; }

 private:
  std::byte* data_ = nullptr;
  std::size_t bytes_ = 0;
};

}  // namespace arboretum
