// Counters as a template parameter: NoCounters compiles to nothing, so the timed kernels carry none.
#pragma once

#include "structures/leaves/leaf_form.h"
#include "traversal/kernel_table.h"

namespace arboretum {

struct NoCounters {
  static constexpr bool kCounting = false;
  explicit NoCounters(Counters*) noexcept {}
  void node(unsigned, unsigned, unsigned) const noexcept {}
  void leaf(const LeafForm&, const std::byte*, unsigned) const noexcept {}
};

struct WithCounters {
  static constexpr bool kCounting = true;
  Counters& counters;
  explicit WithCounters(Counters* c) noexcept : counters(*c) {}

  /// An inner node of `boxes` child boxes, tested in `lanes` lanes, of which the ray meets `hit`.
  void node(unsigned boxes, unsigned lanes, unsigned hit) const noexcept;
  /// A whole leaf of `count` blocks; an any hit that ends earlier counts as if it went on.
  void leaf(const LeafForm& form, const std::byte* blocks, unsigned count) const noexcept;
};

}  // namespace arboretum
