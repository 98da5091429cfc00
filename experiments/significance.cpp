#include "experiments/significance.h"

#include <algorithm>
#include <boost/math/distributions/students_t.hpp>
#include <cmath>
#include <numeric>

namespace arboretum {
namespace {

constexpr std::size_t kMostExact = 50;  // C(50, 25) is below 2^53: counts are whole numbers

/// Twice the midranks of a's values, then of b's: whole numbers.
std::vector<std::size_t> doubled_ranks(std::span<const double> a, std::span<const double> b) {
  std::vector<double> values(a.begin(), a.end());
  values.insert(values.end(), b.begin(), b.end());
  std::vector<double> sorted = values;
  std::ranges::sort(sorted);
  std::vector<std::size_t> ranks;
  for (double v : values) {
    const auto [first, last] = std::equal_range(sorted.begin(), sorted.end(), v);
    ranks.push_back(static_cast<std::size_t>((first - sorted.begin()) + (last - sorted.begin())) + 1);
  }
  return ranks;
}

double exact_p(const std::vector<std::size_t>& ranks, std::size_t n) {
  const std::size_t total = std::accumulate(ranks.begin(), ranks.end(), std::size_t{0});
  const std::size_t observed =
      std::accumulate(ranks.begin(), ranks.begin() + static_cast<std::ptrdiff_t>(n), std::size_t{0});
  // ways[k * (total + 1) + s]: choices of k values whose doubled ranks sum to s.
  std::vector<double> ways((n + 1) * (total + 1), 0.0);
  ways[0] = 1.0;
  for (std::size_t rank : ranks)
    for (std::size_t k = n; k-- > 0;)
      for (std::size_t s = total + 1 - rank; s-- > 0;)
        ways[(k + 1) * (total + 1) + s + rank] += ways[k * (total + 1) + s];
  // Distances from the mean n * total / ranks.size(), times ranks.size() to stay whole.
  const auto distance = [&](std::size_t s) {
    const std::size_t at = s * ranks.size(), middle = n * total;
    return at > middle ? at - middle : middle - at;
  };
  double as_far = 0.0, all = 0.0;
  for (std::size_t s = 0; s <= total; ++s) {
    const double count = ways[n * (total + 1) + s];
    all += count;
    if (distance(s) >= distance(observed)) as_far += count;
  }
  return as_far / all;
}

double normal_p(const std::vector<std::size_t>& ranks, std::size_t n) {
  const double count = static_cast<double>(ranks.size()), na = static_cast<double>(n), nb = count - na;
  double sum = 0.0, squares = 0.0;  // of ranks, and of all ranks about their mean: ties make them less
  for (std::size_t i = 0; i < ranks.size(); ++i) {
    const double rank = 0.5 * static_cast<double>(ranks[i]), off = rank - 0.5 * (count + 1.0);
    if (i < n) sum += rank;
    squares += off * off;
  }
  const double variance = na * nb * squares / (count * (count - 1.0));
  if (variance <= 0.0) return 1.0;
  const double z = std::max(0.0, std::abs(sum - 0.5 * na * (count + 1.0)) - 0.5) / std::sqrt(variance);
  return std::min(1.0, std::erfc(z / std::sqrt(2.0)));
}

}  // namespace

double mann_whitney_p(std::span<const double> a, std::span<const double> b) {
  if (a.empty() || b.empty()) return 1.0;
  const std::vector<std::size_t> ranks = doubled_ranks(a, b);
  return ranks.size() <= kMostExact ? exact_p(ranks, a.size()) : normal_p(ranks, a.size());
}

double welch_p(std::span<const double> a, std::span<const double> b) {
  if (a.size() < 2 || b.size() < 2) return 1.0;
  struct Sample {
    double mean, variance_of_mean, degrees;
    explicit Sample(std::span<const double> values) {
      const double n = static_cast<double>(values.size());
      mean = std::accumulate(values.begin(), values.end(), 0.0) / n;
      double squares = 0.0;
      for (double v : values) squares += (v - mean) * (v - mean);
      degrees = n - 1.0, variance_of_mean = squares / (degrees * n);
    }
  };
  const Sample x(a), y(b);
  const double variance = x.variance_of_mean + y.variance_of_mean, difference = std::abs(x.mean - y.mean);
  if (variance <= 0.0) return difference > 0.0 ? 0.0 : 1.0;
  const double degrees =
      variance * variance /
      (x.variance_of_mean * x.variance_of_mean / x.degrees + y.variance_of_mean * y.variance_of_mean / y.degrees);
  const boost::math::students_t distribution(degrees);
  return std::min(1.0, 2.0 * boost::math::cdf(boost::math::complement(distribution, difference / std::sqrt(variance))));
}

std::string_view to_string(SignificanceTest test) noexcept {
  switch (test) {
    case SignificanceTest::none: return "none";
    case SignificanceTest::mann_whitney: return "mann_whitney";
    case SignificanceTest::welch: return "welch";
  }
  return "";
}

double p_value(SignificanceTest test, std::span<const double> a, std::span<const double> b) {
  if (test == SignificanceTest::none) return 1.0;
  if (test == SignificanceTest::mann_whitney) return mann_whitney_p(a, b);
  const auto logs = [](std::span<const double> rates) {
    std::vector<double> out;
    for (double rate : rates) out.push_back(std::log(rate));
    return out;
  };
  return welch_p(logs(a), logs(b));
}

double smallest_p(std::size_t a, std::size_t b) noexcept {
  double ways = 1.0;
  for (std::size_t i = 1; i <= a; ++i) ways *= static_cast<double>(b + i) / static_cast<double>(i);
  return std::min(1.0, 2.0 / ways);
}

std::vector<double> benjamini_hochberg(std::span<const double> p) {
  std::vector<std::size_t> order(p.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::ranges::sort(order, {}, [&](std::size_t i) { return p[i]; });
  std::vector<double> adjusted(p.size());
  double least = 1.0;
  for (std::size_t k = order.size(); k-- > 0;) {
    least = std::min(least, p[order[k]] * static_cast<double>(p.size()) / static_cast<double>(k + 1));
    adjusted[order[k]] = least;
  }
  return adjusted;
}

}  // namespace arboretum
