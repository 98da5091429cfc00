// What repeated measurements say: median, its 95 % bootstrap interval, mean, deviation.
#pragma once

#include <span>

namespace arboretum {

struct Interval {
  double median = 0.0, low = 0.0, high = 0.0;
};

[[nodiscard]] double median(std::span<const double> values);
[[nodiscard]] double mean(std::span<const double> values);
/// Sample standard deviation; 0 below two values.
[[nodiscard]] double standard_deviation(std::span<const double> values);
/// Median with the 2.5 and 97.5 percentiles of the medians of 1000 resamples (Efron 1979). The same values
/// always give the same interval. Below three values the interval is their range.
[[nodiscard]] Interval bootstrap_median(std::span<const double> values);

}  // namespace arboretum
