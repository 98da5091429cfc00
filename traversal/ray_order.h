// The order in which stream_sorted takes the rays of a batch.
#pragma once

#include <cstdint>
#include <vector>

#include "core/ray.h"

namespace arboretum {

/// Every index of the batch once: by the octant of the direction, then along a Morton curve through the origins (256
/// cells an axis of their common cube), then as they stand. Rays that are not valid may stand anywhere. At most 2^32
/// rays; runs on the calling thread alone.
[[nodiscard]] std::vector<std::uint32_t> ray_order(RayBatch rays);

}  // namespace arboretum
