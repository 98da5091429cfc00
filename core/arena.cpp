#include "core/arena.h"

#include "core/memory_meter.h"
#include "core/reserved_array.h"

namespace arboretum {

Arena::Arena(std::size_t bytes) : bytes_(bytes) {
  if (bytes > 0) data_ = static_cast<std::byte*>(allocate_metered(bytes));
}

Arena::Arena(ReservedArray<std::byte>&& array) noexcept : bytes_(array.counted()) { data_ = array.release(); }

Arena::~Arena() {
  if (data_) release_metered(data_, bytes_);
}

}  // namespace arboretum
