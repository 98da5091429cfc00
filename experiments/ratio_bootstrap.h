// How far the ratio of two medians may be off: the bootstrap (Efron 1979) of its logarithm.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "experiments/sampling.h"

namespace arboretum {

inline constexpr std::size_t kResamples = 2000;
using Replicates = std::vector<double>;  ///< logarithms of ratios, kResamples of them

/// Logarithms of the ratio of the medians, b's to a's, of samples drawn anew from both. The same for a name and its
/// values whatever else is compared.
[[nodiscard]] Replicates log_ratios(const std::string& name, const std::vector<double>& a,
                                    const std::vector<double>& b);

/// The ratio, and the 2.5 and 97.5 percentiles of its replicates: of two samples of 5 repetitions or more they hold the
/// ratio at least 95 times in 100, of fewer less often (docs/command-line.md).
[[nodiscard]] Interval ratio_interval(double log_centre, Replicates logs);

}  // namespace arboretum
