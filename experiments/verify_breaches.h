// What `verify` keeps of broken promises: the smallest case that could be made of each, as a cases file has it, or the
// ray alone; and what it says of them in the end.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "core/mesh.h"
#include "experiments/registry.h"
#include "experiments/verification.h"

namespace arboretum {

class KeptBreaches {
 public:
  explicit KeptBreaches(const Registry& registry) : registry_(registry) {}

  /// Of the rays of the last batch: a case for each cell that breaks its promise and has none yet. `mesh` is what they
  /// were traced on, `name` that of its case; `cells` are the same at each call, and their newest breaches are taken.
  void keep(std::vector<VerifiedCell>& cells, const TriangleMesh& mesh, std::size_t variant, const std::string& name);
  /// A cases file: the cases, and as `unreduced` rays of cells that have none; empty where there are neither.
  [[nodiscard]] std::string document() const;

 private:
  /// Variant and ray: each variant counts from 0.
  using RayNumber = std::pair<std::size_t, std::uint64_t>;

  /// What is kept of a cell's breaches.
  struct Kept {
    bool has_case = false;
    unsigned tries = 0;
    RayNumber ray{};    ///< the first that no case could be made of
    std::string words;  ///< of that ray; empty: none
  };

  [[nodiscard]] std::vector<std::string> unreduced() const;

  const Registry& registry_;
  std::vector<Kept> kept_;  ///< of each cell
  std::set<RayNumber> case_rays_;
  std::vector<std::string> cases_;
};

/// How many cells keep what they promise, and the first that do not.
struct PromisesKept {
  std::size_t broken = 0, promising = 0, untested = 0;  ///< cells; the last had no ray
  std::string lines;                                    ///< of cells that break theirs: describe_breach() of each
};
[[nodiscard]] PromisesKept promises_kept(const std::vector<VerifiedCell>& cells);

}  // namespace arboretum
