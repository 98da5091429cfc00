#include "experiments/sampling.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "core/random.h"

namespace arboretum {

double median(std::span<const double> values) {
  if (values.empty()) return 0.0;
  std::vector<double> sorted(values.begin(), values.end());
  std::ranges::sort(sorted);
  const std::size_t half = sorted.size() / 2;
  return sorted.size() % 2 ? sorted[half] : 0.5 * (sorted[half - 1] + sorted[half]);
}

double mean(std::span<const double> values) {
  if (values.empty()) return 0.0;
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double standard_deviation(std::span<const double> values) {
  if (values.size() < 2) return 0.0;
  const double centre = mean(values);
  double sum = 0.0;
  for (double v : values) sum += (v - centre) * (v - centre);
  return std::sqrt(sum / static_cast<double>(values.size() - 1));
}

Interval bootstrap_median(std::span<const double> values) {
  constexpr std::size_t kResamples = 1000;
  if (values.empty()) return {};
  const auto [least, most] = std::ranges::minmax(values);
  if (values.size() < 3) return {median(values), least, most};
  std::vector<double> medians(kResamples), picked(values.size());
  for (std::size_t i = 0; i < kResamples; ++i) {
    for (std::size_t j = 0; j < picked.size(); ++j) {
      picked[j] = values[static_cast<std::size_t>(random_double(1, i, j) * static_cast<double>(values.size()))];
    }
    medians[i] = median(picked);
  }
  std::ranges::sort(medians);
  return {median(values), medians[kResamples * 25 / 1000], medians[kResamples * 975 / 1000 - 1]};
}

}  // namespace arboretum
