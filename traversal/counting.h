// Counters as a template parameter: NoCounters compiles to nothing, so the timed kernels carry none.
#pragma once

#include "traversal/kernel_table.h"

namespace arboretum {

struct NoCounters {
  static constexpr bool kCounting = false;
  explicit NoCounters(Counters*) noexcept {}
};

struct WithCounters {
  static constexpr bool kCounting = true;
  Counters& counters;
  explicit WithCounters(Counters* c) noexcept : counters(*c) {}
};

}  // namespace arboretum
