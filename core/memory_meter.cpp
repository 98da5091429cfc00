#include "core/memory_meter.h"

#include <atomic>
#include <cstdint>
#include <cstdlib>
#include <new>

#include <sys/mman.h>
#include <unistd.h>

namespace arboretum {
namespace {
std::atomic<std::size_t> current_bytes{0};
std::atomic<std::size_t> peak_bytes{0};
constexpr std::size_t kHugePage = std::size_t{2} << 20;
}  // namespace

void MemoryMeter::add(std::size_t bytes) noexcept {
  const std::size_t now = current_bytes.fetch_add(bytes, std::memory_order_relaxed) + bytes;
  std::size_t peak = peak_bytes.load(std::memory_order_relaxed);
  while (now > peak && !peak_bytes.compare_exchange_weak(peak, now, std::memory_order_relaxed)) {
  }
}

void MemoryMeter::remove(std::size_t bytes) noexcept { current_bytes.fetch_sub(bytes, std::memory_order_relaxed); }
std::size_t MemoryMeter::current() noexcept { return current_bytes.load(std::memory_order_relaxed); }
std::size_t MemoryMeter::peak() noexcept { return peak_bytes.load(std::memory_order_relaxed); }
void MemoryMeter::reset_peak() noexcept { peak_bytes.store(current(), std::memory_order_relaxed); }

void* allocate_uncounted(std::size_t bytes) {
  void* data = nullptr;
  if (posix_memalign(&data, bytes >= kHugePage ? kHugePage : 64, bytes) != 0) throw std::bad_alloc();
  if (bytes >= kHugePage) (void)madvise(data, bytes, MADV_HUGEPAGE);  // a wish, not a need
  return data;
}

void release_uncounted(void* data) noexcept { std::free(data); }

std::size_t give_back_pages(void* begin, void* end) noexcept {
  static const std::uintptr_t page = std::uintptr_t(sysconf(_SC_PAGESIZE));
  const std::uintptr_t first = (reinterpret_cast<std::uintptr_t>(begin) + page - 1) / page * page,
                       last = reinterpret_cast<std::uintptr_t>(end) / page * page;
  if (first >= last || madvise(reinterpret_cast<void*>(first), last - first, MADV_DONTNEED) != 0) return 0;
  return last - first;
}

void* allocate_metered(std::size_t bytes) {
  void* data = allocate_uncounted(bytes);
  MemoryMeter::add(bytes);
  return data;
}

void release_metered(void* data, std::size_t bytes) noexcept {
  MemoryMeter::remove(bytes);
  release_uncounted(data);
}

}  // namespace arboretum
