// Checks of builder parameters and mesh sizes that structures and builders share, and their limits.
#pragma once

#include <cstddef>
#include <string_view>

namespace arboretum {

/// Of BuilderParameters::bins.
inline constexpr unsigned kFewestBins = 4, kMostBins = 64;
/// References that a tree of two nodes each can have, numbered in 31 bits.
inline constexpr std::size_t kMaxReferences = (std::size_t{1} << 30) - 1;

/// Throw UserError unless `value` is within [lowest, highest]; NaN is not.
void require_within(std::string_view parameter, unsigned value, unsigned lowest, unsigned highest);
void require_within(std::string_view parameter, float value, float lowest, float highest);
/// Throws UserError as these do.
void require_bins(unsigned bins);
/// Throws UserError for more than `most` triangles, which is a power of two less one.
void require_triangles(std::string_view structure, std::size_t triangles, std::size_t most = kMaxReferences);

}  // namespace arboretum
