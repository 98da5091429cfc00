// Radix sort of 64-bit keys, least significant digit first: stable, parallel, the same for any number of threads.
#pragma once

#include <cstdint>

#include "core/memory_meter.h"

namespace arboretum {

/// Sorts `keys` by their bits [low, high); keys equal there keep their order. Runs in the caller's TBB arena and needs
/// as much memory again while it works.
void radix_sort(MeteredVector<std::uint64_t>& keys, unsigned low, unsigned high);

}  // namespace arboretum
