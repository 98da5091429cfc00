// MemoryMeter: counts the bytes that builders and structures hold, so that peak build memory is measured, not guessed.
#pragma once

#include <cstddef>
#include <new>
#include <vector>

namespace arboretum {

/// Process-wide running total and peak of the bytes allocated through Arena and MeteredVector, and of what a
/// ReservedArray has handed out and not got back. Thread-safe. A builder's peak is peak() - current() as it was at
/// reset_peak(); of builds at once structures/accel.cpp says what is measured.
class MemoryMeter {
 public:
  static void add(std::size_t bytes) noexcept;
  static void remove(std::size_t bytes) noexcept;
  [[nodiscard]] static std::size_t current() noexcept;
  [[nodiscard]] static std::size_t peak() noexcept;
  /// Sets the peak to the current total.
  static void reset_peak() noexcept;
};

/// Uninitialised bytes, metered: aligned to 64, or to 2 MiB and on huge pages (where the kernel grants them) when that
/// many are asked for. Huge pages save faults while building (docs/performance.md) and TLB misses while tracing. Throws
/// std::bad_alloc.
[[nodiscard]] void* allocate_metered(std::size_t bytes);
/// Gives back what allocate_metered(bytes) gave.
void release_metered(void* data, std::size_t bytes) noexcept;
/// The same without counting: the caller counts what it uses of it (core/reserved_array.h).
[[nodiscard]] void* allocate_uncounted(std::size_t bytes);
/// Gives back what allocate_uncounted() gave.
void release_uncounted(void* data) noexcept;
/// Hands the whole pages of [begin, end), a part of such an allocation whose values are needed no more, back to the
/// system. Returns their bytes.
std::size_t give_back_pages(void* begin, void* end) noexcept;

/// For builders' arrays. Elements are default-initialised (left as they are for trivial types), since builders
/// overwrite whole arrays.
template <class T>
struct MeteredAllocator {
  static_assert(alignof(T) <= 64);
  using value_type = T;
  MeteredAllocator() = default;
  template <class U>
  MeteredAllocator(const MeteredAllocator<U>&) noexcept {}
  T* allocate(std::size_t n) { return static_cast<T*>(allocate_metered(n * sizeof(T))); }
  void deallocate(T* p, std::size_t n) noexcept { release_metered(p, n * sizeof(T)); }
  template <class U>
  void construct(U* p) noexcept(noexcept(::new (p) U)) {
    ::new (static_cast<void*>(p)) U;
  }
  template <class U, class... Args>
  void construct(U* p, Args&&... args) {
    ::new (static_cast<void*>(p)) U(static_cast<Args&&>(args)...);
  }
  template <class U>
  bool operator==(const MeteredAllocator<U>&) const noexcept {
    return true;
  }
};

template <class T>
using MeteredVector = std::vector<T, MeteredAllocator<T>>;

}  // namespace arboretum
