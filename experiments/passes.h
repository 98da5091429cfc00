// How many passes, pictures or builds a repetition of a cell has. All repetitions have as many, as Google Benchmark
// wants it, so the number is found before the first; one pass that was interrupted, or found its memory cold, must not
// make all of them short. So the least of several passes counts.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace arboretum {

/// Most passes of a repetition, and most builds, around each of which more is done than is timed.
inline constexpr std::uint64_t kMostPasses = 1'000'000, kMostBuilds = 10'000;
/// Builds of a repetition need last no longer than this, whatever min_time is: one is long beside the clock's grain,
/// and a sweep has many.
inline constexpr double kEnoughOfBuilds = 0.02;

/// The number that lasts `min_time` seconds at least; 1 to `most`. `pass()` does one and returns its seconds by the
/// clock that the cell is measured by: it is called twice at least, where min_time is above zero, and until its calls
/// have lasted half of min_time.
template <class Pass>
[[nodiscard]] std::uint64_t passes_lasting(double min_time, std::uint64_t most, const Pass& pass) {
  constexpr double kLeastSeconds = 1e-9;
  double least = std::max(pass(), kLeastSeconds), sum = least;
  for (std::uint64_t done = 1; min_time > 0.0 && done < most && (done < 2 || sum < 0.5 * min_time); ++done) {
    const double seconds = std::max(pass(), kLeastSeconds);
    least = std::min(least, seconds), sum += seconds;
  }
  return static_cast<std::uint64_t>(std::clamp(std::ceil(min_time / least), 1.0, static_cast<double>(most)));
}

}  // namespace arboretum
