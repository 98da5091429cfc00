// How many threads a build may take.
#pragma once

#include <tbb/global_control.h>

#include <algorithm>
#include <cstddef>

namespace arboretum {

/// `threads`, but at most what TBB may use here: more would be a line of its own on stderr, in whatever program, and
/// far more a crash. At least 1.
[[nodiscard]] inline unsigned allowed_threads(unsigned threads) {
  const auto most = tbb::global_control::active_value(tbb::global_control::max_allowed_parallelism);
  return unsigned(std::clamp<std::size_t>(threads, 1, most));
}

}  // namespace arboretum
