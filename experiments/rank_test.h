// Whether two samples differ: the Mann-Whitney U test (Mann and Whitney 1947), exact for small samples, and the correction of many
// such tests at once (Benjamini and Hochberg 1995). Nothing is assumed of how repetitions are distributed.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace arboretum {

/// Two-sided p-value. Up to 50 values in all it is exact, ties included: the share of all ways to deal the values to the two samples
/// whose rank sum lies as far from its mean. Beyond that by the normal distribution with corrections for ties and continuity.
/// 1 where a sample is empty.
[[nodiscard]] double mann_whitney_p(std::span<const double> a, std::span<const double> b);

/// The smallest p-value that samples of these sizes can reach: 2 / C(a + b, a).
[[nodiscard]] double smallest_p(std::size_t a, std::size_t b) noexcept;

/// Adjusted p-values: those at most q name findings of which a share of q is false, at most, on average.
[[nodiscard]] std::vector<double> benjamini_hochberg(std::span<const double> p);

}  // namespace arboretum
