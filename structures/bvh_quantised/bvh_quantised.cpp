#include "structures/bvh_quantised/bvh_quantised.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>

#include "structures/bvh/wide_bvh.h"

namespace arboretum::bvh_quantised {
namespace {

constexpr int kBias = 127, kLeast = 1 + int(plane_shift(2)), kMost = 254;
constexpr double kMostSteps = kMostPlane;

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
  // Flat: every q is 0, and a step of 1 makes no subnormal numbers on the way
  if (d.high == 0.0) return {lower, kBias};
  // d.high is at least 2^9 steps, or the step is the least
  int exponent = std::clamp(std::ilogb(d.high) - int(kPlaneBits - 1) + kBias, kLeast, kMost);
  while (steps(d, exponent) > kMostSteps || (steps(d, exponent) == kMostSteps && d.low > 0.0)) ++exponent;
  return {lower, std::uint8_t(exponent)};
}

unsigned plane_below(const Grid& grid, float x) noexcept {
  const Distance d(x, grid.origin);
  const double exact = steps(d, grid.exponent), whole = std::floor(exact);
  const double finite = std::floor(std::ldexp(double(std::numeric_limits<float>::max()), kBias - grid.exponent));
  return unsigned(std::min(finite, whole == exact && d.low < 0.0 ? whole - 1.0 : whole));
}

unsigned plane_above(const Grid& grid, float x) noexcept {
  const Distance d(x, grid.origin);
  const double exact = steps(d, grid.exponent), whole = std::ceil(exact);
  return unsigned(whole == exact && d.low > 0.0 ? whole + 1.0 : whole);
}

float plane_of(const Grid& grid, unsigned q) noexcept {
  return float(q) * std::ldexp(1.0f, grid.exponent - kBias) + grid.origin;
}

template <int N>
Grid grid_of(const Node<N>& node, int axis) noexcept {
  const int shift = int(plane_shift(unsigned(axis)));
  if constexpr (requires { node.step; }) {
    return {node.origin[axis], std::uint8_t(std::ilogb(node.step[axis]) + kBias + shift)};
  } else {
    return {node.origin[axis], std::uint8_t(node.exponent[axis] + shift)};
  }
}
template Grid grid_of(const Node<4>&, int) noexcept;
template Grid grid_of(const Node<8>&, int) noexcept;

template <int N>
void QuantisedNodes<N>::write(Node& node, const Bounds3f* boxes, const bvh::NodeReference* references,
                              unsigned count) noexcept {
  std::memset(static_cast<void*>(&node), 0, sizeof node);
  Bounds3f all;
  for (unsigned i = 0; i < count; ++i) all.extend(boxes[i]), node.child[i] = references[i];
  node.children = std::uint8_t((1u << count) - 1u);
  for (int axis = 0; axis < 3; ++axis) {
    const unsigned shift = plane_shift(unsigned(axis));
    const Grid grid = count == 0 ? Grid{0.0f, kBias} : grid_over(all.lower[axis], all.upper[axis]);
    node.origin[axis] = grid.origin;
    if constexpr (requires { node.step; }) {
      node.step[axis] = std::ldexp(1.0f, grid.exponent - kBias - int(shift));
    } else {
      node.exponent[axis] = std::uint8_t(grid.exponent - shift);
    }
    for (unsigned i = 0; i < count; ++i) {
      node.planes[0][i] |= plane_below(grid, boxes[i].lower[axis]) << shift;
      node.planes[1][i] |= plane_above(grid, boxes[i].upper[axis]) << shift;
    }
  }
}

template <int N>
unsigned QuantisedNodes<N>::read(const Node& node, Bounds3f* boxes, bvh::NodeReference* references) noexcept {
  unsigned i = 0;
  for (; i < unsigned(N) && (node.children >> i & 1u); ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      const Grid grid = grid_of(node, axis);
      boxes[i].lower[axis] = plane_of(grid, node.plane(unsigned(axis), 0, i));
      boxes[i].upper[axis] = plane_of(grid, node.plane(unsigned(axis), 1, i));
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
