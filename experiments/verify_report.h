// What `verify` prints and writes.
#pragma once

#include <string>
#include <vector>

#include "experiments/verification.h"

namespace arboretum {

/// One way in which a scene was placed.
struct VerifyVariant {
  double offset = 0;
  int exponent = 0;  ///< scaled by 2^exponent
};

/// A table for each intersector and box test, under what they promise; one row a cell. With `by_kind`, also one for
/// each of them of the wrong answers per million by kind of ray, summed over the cells.
[[nodiscard]] std::string verify_tables(const std::vector<VerifiedCell>& cells, bool by_kind);
/// One row a cell, variant and kind of ray that has rays.
[[nodiscard]] std::string verify_csv(const std::vector<VerifiedCell>& cells,
                                     const std::vector<VerifyVariant>& variants);
/// structure/builder/leaf/intersector/box/traversal/isa
[[nodiscard]] std::string cell_label(const Cell& cell);
/// "bvh8/…: lost through a closed surface: ray …, exact …, answer …": the first ray on which a cell broke its promise.
[[nodiscard]] std::string describe_breach(const VerifiedCell& cell, const VerifyTally& sum);

}  // namespace arboretum
