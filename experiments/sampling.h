// What repeated measurements say: median, the interval that it lies in, mean, deviation.
#pragma once

#include <cstddef>
#include <span>
#include <string>

namespace arboretum {

struct Interval {
  double median = 0.0, low = 0.0, high = 0.0;
};

/// Fewer values than these have no interval that covers their median in 95 of 100 cases.
inline constexpr std::size_t kFewestOfInterval = 6;

[[nodiscard]] double median(std::span<const double> values);
[[nodiscard]] double mean(std::span<const double> values);
/// Sample standard deviation; 0 below two values.
[[nodiscard]] double standard_deviation(std::span<const double> values);
/// Median with its 95 % interval, whatever the values' distribution: between the pair of order statistics that covers
/// it more often and the next pair, which does less often, interpolated after Hettmansperger and Sheather (1986,
/// Statistics & Probability Letters 4). Below kFewestOfInterval values the interval is their range; of one value it is
/// none.
[[nodiscard]] Interval median_interval(std::span<const double> values);
/// How often the range of so many values covers their distribution's median: 1 - 2^(1 - n).
[[nodiscard]] double range_coverage(std::size_t values);
/// What the intervals of samples of `least` to `most` values are: "95 %", "range", "95 % or range"; where each is of
/// one value, which has none, just "interval".
[[nodiscard]] std::string interval_name(std::size_t least, std::size_t most);

}  // namespace arboretum
