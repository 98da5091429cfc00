#include "experiments/ratio_bootstrap.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/random.h"
#include "experiments/fnv.h"

namespace arboretum {
namespace {

double resampled_median(const std::vector<double>& values, std::uint64_t seed, std::size_t i,
                        std::vector<double>& picked) {
  picked.resize(values.size());
  for (std::size_t j = 0; j < values.size(); ++j)
    picked[j] = values[static_cast<std::size_t>(random_double(seed, i, j) * static_cast<double>(values.size()))];
  return median(picked);
}

}  // namespace

Replicates log_ratios(const std::string& name, const std::vector<double>& a, const std::vector<double>& b) {
  const std::uint64_t seed = fnv1a(name);
  Replicates logs(kResamples);
  std::vector<double> picked;
  for (std::size_t i = 0; i < kResamples; ++i)
    logs[i] = std::log(resampled_median(b, mix64(seed + 1), i, picked) / resampled_median(a, mix64(seed), i, picked));
  return logs;
}

Interval ratio_interval(double log_centre, Replicates logs) {
  std::ranges::sort(logs);
  return {std::exp(log_centre), std::exp(logs[kResamples * 25 / 1000]), std::exp(logs[kResamples * 975 / 1000 - 1])};
}

}  // namespace arboretum
