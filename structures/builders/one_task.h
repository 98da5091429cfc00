// The size of subtrees at which builders stop making tasks.
#pragma once

#include <cstddef>

namespace arboretum {

/// References: subtrees of so many, or fewer, are built by one task.
inline constexpr std::size_t kOneTask = 1u << 12;

}  // namespace arboretum
