// Asking for cache lines ahead of their use.
#pragma once

#include <cstddef>

#include "simd/simd.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Cache lines that may hold some of `bytes`: nodes and leaves begin on multiples of 32.
[[nodiscard]] constexpr int lines_of(std::size_t bytes) { return int((bytes + 32 + 63) / 64); }

template <int Lines>
ARBORETUM_INLINE void prefetch_lines(const std::byte* at) {
  for (int line = 0; line < Lines; ++line) _mm_prefetch(reinterpret_cast<const char*>(at) + 64 * line, _MM_HINT_T0);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
