// VerifyTally: what `verify` counts of one cell's answers.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/ray.h"
#include "oracle/hard_rays.h"
#include "oracle/oracle.h"

namespace arboretum {

/// Errors by their size, sixteen bins an octave: quantiles are given to within 4.5 % upwards, the largest exactly.
class ErrorHistogram {
 public:
  void add(double error);
  ErrorHistogram& operator+=(const ErrorHistogram& other);
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  /// The size that a share `p` of the errors does not exceed; 0 where there is none.
  [[nodiscard]] double quantile(double p) const;
  [[nodiscard]] double max() const noexcept { return max_; }

 private:
  std::vector<std::uint64_t> bins_;  ///< up to that of the largest error
  std::uint64_t count_ = 0;
  double max_ = 0;
};

/// The first ray, in their order, on which a promise is broken.
struct Breach {
  std::uint64_t ray = ~std::uint64_t{0};
  std::string what;  ///< "lost through a closed surface"; empty: none
  Ray given;
  float time = 0;
  HardKind kind = HardKind::given;
  ExactHit truth;
  Hit answer;
  bool any = false;
};

struct VerifyTally {
  std::uint64_t rays = 0, exact_hits = 0;
  /// as AnswerCheck has them
  std::uint64_t missed = 0, false_hits = 0, wrong_surface = 0, wrong_primitive = 0, cracks = 0;
  std::uint64_t any_missed = 0, any_false = 0;
  std::uint64_t self_hits = 0;  ///< of the triangle that the ray starts on, where that is not the exact answer
  std::uint64_t differs = 0;    ///< t or primitive is not that of the first cell with the same intersector, box and ISA
  std::uint64_t broken = 0;     ///< rays on which the cell breaks its promise
  std::uint64_t in_company = 0;  ///< of those traced among others as well: answers with a fault there and none alone
  ErrorHistogram t_ulp, uv;      ///< where the primitive or the surface is right; where the primitive is the oracle's
  Breach first;

  VerifyTally& operator+=(const VerifyTally& other);
  [[nodiscard]] std::uint64_t wrong() const noexcept { return missed + false_hits + wrong_surface; }
  /// Answers that differ from the exact ones in anything.
  [[nodiscard]] std::uint64_t faults() const noexcept {
    return wrong() + wrong_primitive + any_missed + any_false + in_company;
  }
};

}  // namespace arboretum
