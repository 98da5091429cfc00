// Whether two samples differ: the Mann-Whitney U test (Mann and Whitney 1947), exact for small samples, which assumes
// nothing of how repetitions are distributed; Welch's t test (Welch 1947), which assumes that they are normal, but can
// tell a difference apart that is large against the noise where repetitions are too few for ranks to; and the
// correction of many tests at once (Benjamini and Hochberg 1995).
#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

namespace arboretum {

/// Two-sided p-value. Up to 50 values in all it is exact, ties included: the share of all ways to deal the values to
/// the two samples whose rank sum lies as far from its mean. Beyond that by the normal distribution with corrections
/// for ties and continuity. 1 where a sample is empty.
[[nodiscard]] double mann_whitney_p(std::span<const double> a, std::span<const double> b);

/// Two-sided p-value of Welch's test for equal means, with the degrees of freedom of Welch and Satterthwaite. 1 where a
/// sample has fewer than two values; without any spread 0 where the means differ, 1 where they do not.
[[nodiscard]] double welch_p(std::span<const double> a, std::span<const double> b);

/// `none`: of a single repetition.
enum class SignificanceTest { none, mann_whitney, welch };
[[nodiscard]] std::string_view to_string(SignificanceTest test) noexcept;

/// Two-sided p-value of two samples of rates; Welch's test takes their logarithms. 1 of `none`.
[[nodiscard]] double p_value(SignificanceTest test, std::span<const double> a, std::span<const double> b);

/// The smallest p-value that the Mann-Whitney test of samples of these sizes can reach: 2 / C(a + b, a).
[[nodiscard]] double smallest_p(std::size_t a, std::size_t b) noexcept;

/// Adjusted p-values: those at most q name findings of which a share of q is false, at most, on average.
[[nodiscard]] std::vector<double> benjamini_hochberg(std::span<const double> p);

}  // namespace arboretum
