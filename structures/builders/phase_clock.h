// PhaseClock: the wall time of a build's phases, one after the other.
#pragma once

#include "structures/accel.h"

namespace arboretum {

class PhaseClock {
 public:
  /// The first phase begins now.
  explicit PhaseClock(BuildReport& report) noexcept;

  /// The phase that ends now took this name in the report, and the next one begins.
  void ends(const char* name);

 private:
  BuildReport& report_;
  double start_;
};

}  // namespace arboretum
