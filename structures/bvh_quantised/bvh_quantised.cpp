#include "structures/bvh_quantised/bvh_quantised.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "structures/bvh/wide_bvh.h"

namespace arboretum::bvh_quantised {
namespace {

constexpr int kBias = 127, kLeast = 1, kMost = 254;

/// x - origin as an unevaluated sum: `high` rounded, `low` what rounding took (Knuth 1969), 0 for most floats.
struct Distance {
  double high, low;
  Distance(float x, float origin) noexcept {
    const double a = x, b = -double(origin);
    high = a + b;
    const double b_part = high - a;
    low = (a - (high - b_part)) + (b - b_part);
  }
};

[[nodiscard]] double steps(const Distance& d, int exponent) noexcept { return std::ldexp(d.high, kBias - exponent); }

}  // namespace

Grid grid_over(float lower, float upper) noexcept {
  const Distance d(upper, lower);
  if (d.high == 0.0) return {lower, kBias};  // flat: every q is 0, and a step of 1 makes no subnormal numbers on the way
  int exponent = std::clamp(std::ilogb(d.high) - 7 + kBias, kLeast, kMost);  // d.high is at least 2^7 steps, or the step is the least
  while (steps(d, exponent) > 255.0 || (steps(d, exponent) == 255.0 && d.low > 0.0)) ++exponent;
  return {lower, std::uint8_t(exponent)};
}

std::uint8_t plane_below(const Grid& grid, float x) noexcept {
  const Distance d(x, grid.origin);
  const double exact = steps(d, grid.exponent), whole = std::floor(exact);
  const double finite = std::floor(std::ldexp(double(std::numeric_limits<float>::max()), kBias - grid.exponent));
  return std::uint8_t(std::min(finite, whole == exact && d.low < 0.0 ? whole - 1.0 : whole));
}

std::uint8_t plane_above(const Grid& grid, float x) noexcept {
  const Distance d(x, grid.origin);
  const double exact = steps(d, grid.exponent), whole = std::ceil(exact);
  return std::uint8_t(whole == exact && d.low > 0.0 ? whole + 1.0 : whole);
}

float plane_of(const Grid& grid, std::uint8_t q) noexcept { return float(q) * std::ldexp(1.0f, grid.exponent - kBias) + grid.origin; }

template <int N>
void QuantisedNodes<N>::write(Node& node, const Bounds3f* boxes, const bvh::NodeReference* references, unsigned count) noexcept {
  std::memset(&node, 0, sizeof node);
  Bounds3f all;
  for (unsigned i = 0; i < count; ++i) all.extend(boxes[i]), node.child[i] = references[i];
  node.children = std::uint8_t((1u << count) - 1u);
  for (int axis = 0; axis < 3; ++axis) {
    const Grid grid = count == 0 ? Grid{0.0f, kBias} : grid_over(all.lower[axis], all.upper[axis]);
    node.origin[axis] = grid.origin, node.exponent[axis] = grid.exponent;
    for (unsigned i = 0; i < count; ++i) {
      node.planes[2 * axis][i] = plane_below(grid, boxes[i].lower[axis]);
      node.planes[2 * axis + 1][i] = plane_above(grid, boxes[i].upper[axis]);
    }
  }
}

template <int N>
unsigned QuantisedNodes<N>::read(const Node& node, Bounds3f* boxes, bvh::NodeReference* references) noexcept {
  unsigned i = 0;
  for (; i < unsigned(N) && (node.children >> i & 1u); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      const Grid grid{node.origin[axis], node.exponent[axis]};
      boxes[i].lower[axis] = plane_of(grid, node.planes[2 * axis][i]);
      boxes[i].upper[axis] = plane_of(grid, node.planes[2 * axis + 1][i]);
    }
    references[i] = node.child[i];
  }
  return i;
}

template struct QuantisedNodes<4>;
template struct QuantisedNodes<8>;

}  // namespace arboretum::bvh_quantised

namespace arboretum::bvh {

template class WideBvh<bvh_quantised::QuantisedNodes<4>>;
template class WideBvh<bvh_quantised::QuantisedNodes<8>>;

}  // namespace arboretum::bvh
