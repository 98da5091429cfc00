#include "core/arena.h"

#include <cstdint>

#include "core/memory_meter.h"

namespace arboretum {

Arena::Arena(std::size_t bytes) : bytes_(bytes) {
  if (bytes == 0) return;
  constexpr std::size_t kHugePage = std::size_t{2} << 20;
  const std::size_t alignment = bytes >= kHugePage ? kHugePage : 64;
  data_ = static_cast<std::byte*>(::operator new(bytes, std::align_val_t(alignment)));
  MemoryMeter::add(bytes);
}

Arena::~Arena() {
  if (!data_) return;
  constexpr std::size_t kHugePage = std::size_t{2} << 20;
  ::operator delete(data_, std::align_val_t(bytes_ >= kHugePage ? kHugePage : 64));
  MemoryMeter::remove(bytes_);
}

}  // namespace arboretum
