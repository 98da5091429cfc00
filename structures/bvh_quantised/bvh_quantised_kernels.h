// One ray against the quantised boxes of a node: planes are decoded on the way, near and far ones chosen by the direction's signs as
// in box_test.h, whose constants and promises these are.
//
// With FMA the grid is moved into the ray's parameter once a node: t = q * (step * r) + (origin * r - f), one fused operation a plane.
// step * r is exact (step is a power of two); where it underflows, what is lost is far below the pad's 2^-100. Padded: beside the
// roundings that box_test.h counts, origin * r - f rounds by u (M + |o|)|r|, and planes reach to M + step <= 1.02 M: under 5.1 u (M + |o|)|r|
// in all, still below e = 8 u (M + |o|)|r|. So the interval holds the dequantised box's, and that box holds the child's (bvh_quantised.h).
//
// Without FMA the plane is decoded to float, q * step exactly and one rounding for the sum, and goes the way of any other plane.
#pragma once

#include "simd/swizzle.h"
#include "traversal/usual_leaves.h"
#include "structures/bvh/bvh_packet_rows.h"
#include "structures/bvh/bvh_single.h"
#include "traversal/kernel_rows.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <int N, bool Padded>
struct QuantisedNodeTest {
  static constexpr int W = N, kSlots = N, kStride = 1;
  using F = vf<W>;
  using Node = bvh_quantised::Node<N>;
  F rx, ry, rz, fx, fy, fz, gx, gy, gz, tnear, tfar;
  std::size_t near_x, near_y, near_z, far_x, far_y, far_z;  ///< offsets within Node::planes

  ARBORETUM_INLINE QuantisedNodeTest(const Ray& ray, float max_coordinate)
      : QuantisedNodeTest(BoxRay<N, Padded>(ray, max_coordinate), first_distance(ray), ray.tfar) {}
  ARBORETUM_INLINE QuantisedNodeTest(const BoxRay<N, Padded>& b, float first, float last)
      : rx(b.r.x), ry(b.r.y), rz(b.r.z), fx(b.f.x), fy(b.f.y), fz(b.f.z), gx(b.g.x), gy(b.g.y), gz(b.g.z), tnear(first), tfar(last),
        near_x(b.near_x() / sizeof(float)), near_y(b.near_y() / sizeof(float)), near_z(b.near_z() / sizeof(float)),
        far_x(N - near_x), far_y(5 * N - near_y), far_z(9 * N - near_z) {}

  ARBORETUM_INLINE unsigned test(const std::byte* at, F& entry) const {
    const auto* node = reinterpret_cast<const Node*>(at);
    const std::uint8_t* planes = node->planes[0];
    // One broadcast for the three exponents; each is shifted to where a float has its own.
    std::int32_t packed;
    std::memcpy(&packed, node->exponent, sizeof packed);
    const vi<W> exponents(packed), field(0x7f800000);
    const F step_x = F::from_int_bits(exponents.template shift_left<23>() & field), step_y = F::from_int_bits(exponents.template shift_left<15>() & field),
            step_z = F::from_int_bits(exponents.template shift_left<7>() & field);
    const F ox(node->origin[0]), oy(node->origin[1]), oz(node->origin[2]);
    const auto q = [planes](std::size_t offset) { return to_float(load_bytes<W>(planes + offset)); };
    F nx, ny, nz, lx, ly, lz;
    if constexpr (kHasFma) {
      const F sx = step_x * rx, sy = step_y * ry, sz = step_z * rz;
      const F cx = msub(ox, rx, fx), cy = msub(oy, ry, fy), cz = msub(oz, rz, fz);
      const F dx = Padded ? msub(ox, rx, gx) : cx, dy = Padded ? msub(oy, ry, gy) : cy, dz = Padded ? msub(oz, rz, gz) : cz;
      nx = madd(q(near_x), sx, cx), ny = madd(q(near_y), sy, cy), nz = madd(q(near_z), sz, cz);
      lx = madd(q(far_x), sx, dx), ly = madd(q(far_y), sy, dy), lz = madd(q(far_z), sz, dz);
    } else {
      nx = (q(near_x) * step_x + ox - fx) * rx, ny = (q(near_y) * step_y + oy - fy) * ry, nz = (q(near_z) * step_z + oz - fz) * rz;
      lx = (q(far_x) * step_x + ox - gx) * rx, ly = (q(far_y) * step_y + oy - gy) * ry, lz = (q(far_z) * step_z + oz - gz) * rz;
    }
    entry = max_x86(max_x86(nx, ny), max_x86(nz, tnear));
    const F exit = min_x86(min_x86(lx, ly), min_x86(lz, tfar));
    return (entry <= exit).bits() & node->children;
  }
  ARBORETUM_INLINE void shorten(float t) { tfar = F(t); }
  static ARBORETUM_INLINE const bvh::NodeReference* children(const std::byte* node) { return reinterpret_cast<const Node*>(node)->child; }
  static unsigned boxes(const std::byte* node) { return unsigned(__builtin_popcount(reinterpret_cast<const Node*>(node)->children)); }
};

template <int N>
struct QuantisedTests {
  template <bool Padded>
  using Nodes = QuantisedNodeTest<N, Padded>;
};

/// How packets read a node (structures/bvh/bvh_packet_nodes.h).
template <int N>
struct QuantisedPacketNodes {
  static constexpr int kBranching = N, kLanes = N;
  using Node = bvh_quantised::Node<N>;
  template <bool Padded>
  using Single = QuantisedNodeTest<N, Padded>;

  static ARBORETUM_INLINE float step(const Node* node, unsigned axis) { return __builtin_bit_cast(float, std::uint32_t(node->exponent[axis]) << 23); }
  template <class F>
  static ARBORETUM_INLINE F distance(const std::byte* at, unsigned k, int i, F r, F c) {
    const auto* node = reinterpret_cast<const Node*>(at);
    const F q(float(node->planes[k][i])), size(step(node, k / 2)), origin(node->origin[k / 2]);
    if constexpr (kHasFma) {
      return madd(q, size * r, msub(origin, r, c));
    } else {
      return (q * size + origin - c) * r;
    }
  }
  static ARBORETUM_INLINE vf<N> planes(const std::byte* at, unsigned k) {
    const auto* node = reinterpret_cast<const Node*>(at);
    const vf<N> p = to_float(load_bytes<N>(node->planes[k])) * vf<N>(step(node, k / 2)) + vf<N>(node->origin[k / 2]);
    const vf<N> nowhere(k & 1u ? -std::numeric_limits<float>::infinity() : std::numeric_limits<float>::infinity());
    return select(vm<N>::from_bits(node->children), p, nowhere);
  }
  static ARBORETUM_INLINE bvh::NodeReference child(const std::byte* node, int i) { return Single<true>::children(node)[i]; }
  static unsigned boxes(const std::byte* node) { return Single<true>::boxes(node); }
};

template <int N>
void add_kernels(std::type_identity<bvh::WideBvh<bvh_quantised::QuantisedNodes<N>>>, KernelRows& rows) {
  using Structure = bvh::WideBvh<bvh_quantised::QuantisedNodes<N>>;
  add_rows<Structure, typename BvhSingle<QuantisedTests<N>::template Nodes>::Functions>(rows, "single", UsualLeaves{});
  add_packet_rows<Structure, QuantisedPacketNodes<N>>(rows, TypeList<>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
