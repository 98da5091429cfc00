// Bounds of what `exact` and its oracle compute in doubles from float32 numbers, each in one place: exact_predicate.cpp
// and hit_arithmetic.cpp prove them, the intersectors compute the same in lanes.
#pragma once

namespace arboretum::double_bounds {

/// A determinant of three rounded differences is off by less than this times the product of their largest components.
/// For roundings of the nearest hit, which is seldom next to where a ray starts; what has to be told from tnear takes
/// kTripleProducts.
inline constexpr double kDeterminant = 56 * 0x1p-53;
/// Of the sum of the magnitudes of its six triple products, which carry at most eight roundings each.
inline constexpr double kTripleProducts = 9 * 0x1p-53;
/// The share of itself by which a determinant that is divided by may be off, at most: else there is no bound.
inline constexpr double kMostOfDivisor = 0x1p-9;
/// (n + dn) / (d + dd) - n / d is below (dn + |n / d| dd) / |d| times this where dd is at most kMostOfDivisor of |d|.
inline constexpr double kQuotient = 1 + 0x1p-8;
/// The share of a quotient that its own two roundings (a product with a reciprocal) and that of its bound's ends take,
/// at most.
inline constexpr double kRounding = 0x1p-50;
/// Weights of corners are right to this or better.
inline constexpr double kWeight = 0x1p-30;

}  // namespace arboretum::double_bounds
