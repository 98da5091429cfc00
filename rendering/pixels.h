// The pixels of a picture: which sizes are possible, and the order in which rays take them.
#pragma once

#include <string>

#include "core/error.h"

namespace arboretum {

/// Throws UserError for a picture without pixels or above 65536 a side.
inline void check_resolution(unsigned width, unsigned height) {
  constexpr unsigned kMost = 65536;
  if (width == 0 || height == 0 || width > kMost || height > kMost) {
    throw UserError("resolution " + std::to_string(width) + "x" + std::to_string(height) +
                    " is not possible; each must be within 1 to " + std::to_string(kMost));
  }
}

/// Calls visit(x, y) for the pixels of a square of side `size` (a power of two) at (x, y) that lie in a picture of
/// width x height, in Morton order.
template <class Visit>
void visit_morton(unsigned x, unsigned y, unsigned size, unsigned width, unsigned height, const Visit& visit) {
  if (x >= width || y >= height) return;
  if (size == 1) {
    visit(x, y);
    return;
  }
  const unsigned half = size / 2;
  visit_morton(x, y, half, width, height, visit);
  visit_morton(x + half, y, half, width, height, visit);
  visit_morton(x, y + half, half, width, height, visit);
  visit_morton(x + half, y + half, half, width, height, visit);
}

}  // namespace arboretum
