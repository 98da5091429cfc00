#include "experiments/sampling.h"

#include <algorithm>
#include <boost/math/distributions/binomial.hpp>
#include <cmath>
#include <numeric>
#include <vector>

namespace arboretum {
namespace {

constexpr double kConfidence = 0.95;

}  // namespace

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

Interval median_interval(std::span<const double> values) {
  if (values.empty()) return {};
  std::vector<double> sorted(values.begin(), values.end());
  std::ranges::sort(sorted);
  const std::size_t n = sorted.size();
  const double centre = median(values);
  if (n < kFewestOfInterval) return {centre, sorted.front(), sorted.back()};
  const boost::math::binomial_distribution<double> below(static_cast<double>(n), 0.5);
  // Of the d-th value from either end; values above the median are as many as heads of n coins.
  const auto coverage = [&](std::size_t d) {
    return 1.0 - 2.0 * boost::math::cdf(below, static_cast<double>(d) - 1.0);
  };
  std::size_t d = 1;
  while (coverage(d + 1) >= kConfidence) ++d;
  const double part = (coverage(d) - kConfidence) / (coverage(d) - coverage(d + 1));
  const double inner = static_cast<double>(n - d) * part, outer = static_cast<double>(d) * (1.0 - part);
  const double lambda = inner / (inner + outer);
  return {centre, std::lerp(sorted[d - 1], sorted[d], lambda), std::lerp(sorted[n - d], sorted[n - d - 1], lambda)};
}

double range_coverage(std::size_t values) { return 1.0 - std::exp2(1.0 - static_cast<double>(values)); }

std::string interval_name(std::size_t least, std::size_t most) {
  if (most < 2) return "interval";
  if (least >= kFewestOfInterval) return "95 %";
  return most < kFewestOfInterval ? "range" : "95 % or range";
}

}  // namespace arboretum
