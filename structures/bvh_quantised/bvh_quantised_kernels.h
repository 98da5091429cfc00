// One ray against the quantised boxes of a node: planes are decoded on the way, near and far ones chosen by the
// direction's signs as in box_test.h, whose constants and promises these are.
//
// With FMA the grid is moved into the ray's parameter once a node: t = q * (step * r) + (origin * r - f), one fused
// operation a plane. step * r is exact (step is a power of two); where it underflows, what is lost, 2^-149 times q <
// 2^30, is far below the pad's 2^-100. Padded: beside the roundings that box_test.h counts, origin * r - f rounds by u
// (M + |o|)|r|, and planes reach to M + step <= 1.004 M: under 5.1 u (M + |o|)|r| in all, still below e = 8 u (M +
// |o|)|r|. So the interval holds the dequantised box's, and that box holds the child's (bvh_quantised.h).
//
// Without FMA t = (q * step + (origin - o)) * r, o padded: one rounding more than box_test.h counts, so under 5 u (M +
// |o| + e)|r|, less than e |r|.
#pragma once

#include "simd/swizzle.h"
#include "traversal/usual_leaves.h"
#include "structures/bvh/bvh_queued.h"
#include "structures/bvh/bvh_packet.h"
#include "structures/bvh/bvh_single.h"
#include "traversal/auto_rows.h"
#include "traversal/kernel_rows.h"
#include "traversal/packet_rows.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Axes stand in lanes, again and again in each four: what a node needs of a ray is then two or three registers and
/// costs as many operations, from which each axis' value is spread within its four.
template <int N, bool Padded>
struct QuantisedNodeTest {
  static constexpr int W = N, kSlots = N, kStride = 1;
  static constexpr std::size_t kBytes = sizeof(bvh_quantised::Node<N>);
  using F = vf<W>;
  using Node = bvh_quantised::Node<N>;
  F r, f, g, tnear, tfar;
  /// offsets within Node::planes, in bytes; those of the far planes are kSide ^ these
  std::size_t near_x, near_y, near_z;
  static constexpr std::size_t kSide = N * sizeof(std::uint32_t);

  ARBORETUM_INLINE QuantisedNodeTest(const Ray& ray, float max_coordinate)
      : QuantisedNodeTest(BoxRay<N, Padded>(ray, max_coordinate), first_distance(ray), ray.tfar) {}
  ARBORETUM_INLINE QuantisedNodeTest(BoxRay<N, Padded> b, float first, float last)
      : QuantisedNodeTest(first, last, within_range(b)) {}

  ARBORETUM_INLINE unsigned test(const std::byte* at, F& entry) const {
    const auto* node = reinterpret_cast<const Node*>(at);
    const auto* planes = reinterpret_cast<const std::byte*>(node->planes);
    const F origin = repeat_four<W>(vf<4>::load(node->origin)), step = repeat_four<W>(steps(node));
    const auto x = [](F a) { return permute_in_fours<0, 0, 0, 0>(a); };
    const auto y = [](F a) { return permute_in_fours<1, 1, 1, 1>(a); };
    const auto z = [](F a) { return permute_in_fours<2, 2, 2, 2>(a); };
    const auto q = [planes](std::size_t offset, unsigned axis) {
      return to_float(vi<W>::load(planes + offset) & vi<W>(std::int32_t(bvh_quantised::plane_mask(axis))));
    };
    F nx, ny, nz, lx, ly, lz;
    if constexpr (kHasFma) {
      const F s = step * r, c = msub(origin, r, f), d = Padded ? msub(origin, r, g) : c;
      nx = madd(q(near_x, 0), x(s), x(c)), ny = madd(q(near_y, 1), y(s), y(c)), nz = madd(q(near_z, 2), z(s), z(c));
      lx = madd(q(near_x ^ kSide, 0), x(s), x(d)), ly = madd(q(near_y ^ kSide, 1), y(s), y(d)),
      lz = madd(q(near_z ^ kSide, 2), z(s), z(d));
    } else {
      const F c = origin - f, d = origin - g;
      nx = (q(near_x, 0) * x(step) + x(c)) * x(r), ny = (q(near_y, 1) * y(step) + y(c)) * y(r),
      nz = (q(near_z, 2) * z(step) + z(c)) * z(r);
      lx = (q(near_x ^ kSide, 0) * x(step) + x(d)) * x(r), ly = (q(near_y ^ kSide, 1) * y(step) + y(d)) * y(r),
      lz = (q(near_z ^ kSide, 2) * z(step) + z(d)) * z(r);
    }
    entry = max_x86(max_x86(nx, ny), max_x86(nz, tnear));
    const F exit = min_x86(min_x86(lx, ly), min_x86(lz, tfar));
    return (entry <= exit).bits() & node->children;
  }
  ARBORETUM_INLINE void shorten(float t) { tfar = F(t); }
  static ARBORETUM_INLINE const bvh::NodeReference* children(const std::byte* node) {
    return reinterpret_cast<const Node*>(node)->child;
  }
  static unsigned boxes(const std::byte* node) {
    return unsigned(__builtin_popcount(reinterpret_cast<const Node*>(node)->children));
  }

 private:
  using Box = BoxRay<N, Padded>;

  ARBORETUM_INLINE QuantisedNodeTest(float first, float last, const Box& b)
      : r(axes(b.r)), f(axes(b.near_offset)), g(axes(b.far_offset)), tnear(first), tfar(last),
        near_x((b.octant & 1u) * kSide), near_y((b.octant >> 1 & 1u) * kSide), near_z((b.octant >> 2) * kSide) {}

  static ARBORETUM_INLINE F axes(Vec3f a) { return repeat_four<W>(four(a.x, a.y, a.z, 0.0f)); }
  static ARBORETUM_INLINE vf<4> steps(const Node* node) {
    if constexpr (requires { node->step; }) {
      return vf<4>::load(node->step);
    } else {  // exponents to where a float has its own
      return vf<4>::from_int_bits(load_bytes<4>(node->exponent).template shift_left<23>());
    }
  }

  /// origin * r alone may overflow where the distance itself does not: 2^106 <= 2 e says that (M + |o|)|r| is about
  /// 2^126 or more. Such an axis is left out: no box is missed for it.
  static ARBORETUM_INLINE const Box& within_range(Box& b) {
    if constexpr (kHasFma && Padded) {
      const Vec3f pad = b.near_offset - b.far_offset;
      if (__builtin_expect(!(pad.x < 0x1p106f && pad.y < 0x1p106f && pad.z < 0x1p106f), 0)) {
        for (int a = 0; a < 3; ++a) {
          if ((&pad.x)[a] < 0x1p106f) continue;
          (&b.r.x)[a] = __builtin_copysignf(1.0f, (&b.r.x)[a]);
          (&b.near_offset.x)[a] = std::numeric_limits<float>::max(), (&b.far_offset.x)[a] = -(&b.near_offset.x)[a];
        }
      }
    }
    return b;
  }
};

template <int N>
struct QuantisedTests {
  template <bool Padded>
  using Nodes = QuantisedNodeTest<N, Padded>;
};

/// How packets read a node (structures/bvh/bvh_packet_nodes.h): plane k = 2 * axis + side.
template <int N>
struct QuantisedPacketNodes {
  static constexpr int kBranching = N, kLanes = N;
  using Node = bvh_quantised::Node<N>;
  template <bool Padded>
  using Single = QuantisedNodeTest<N, Padded>;

  static ARBORETUM_INLINE float step(const Node* node, unsigned axis) {
    if constexpr (requires { node->step; }) {
      return node->step[axis];
    } else {
      return __builtin_bit_cast(float, std::uint32_t(node->exponent[axis]) << 23);
    }
  }
  template <class F>
  static ARBORETUM_INLINE F distance(const std::byte* at, unsigned k, int i, F r, F c) {
    const auto* node = reinterpret_cast<const Node*>(at);
    const F q(float(std::int32_t(node->planes[k & 1u][i] & bvh_quantised::plane_mask(k / 2)))), size(step(node, k / 2)),
        origin(node->origin[k / 2]);
    if constexpr (kHasFma) {
      // Where origin * r overflows (within_range(), which packets do not pass), infinity becomes NaN, which leaves the
      // axis out.
      const F moved = msub(origin, r, c);
      return madd(q, size * r, moved + (moved - moved));
    } else {
      return (q * size + (origin - c)) * r;
    }
  }
  static ARBORETUM_INLINE vf<N> planes(const std::byte* at, unsigned k) {
    const auto* node = reinterpret_cast<const Node*>(at);
    const vi<N> q = vi<N>::load(node->planes[k & 1u]) & vi<N>(std::int32_t(bvh_quantised::plane_mask(k / 2)));
    const vf<N> p = to_float(q) * vf<N>(step(node, k / 2)) + vf<N>(node->origin[k / 2]);
    const vf<N> nowhere(k & 1u ? -std::numeric_limits<float>::infinity() : std::numeric_limits<float>::infinity());
    return select(vm<N>::from_bits(node->children), p, nowhere);
  }
  static ARBORETUM_INLINE bvh::NodeReference child(const std::byte* node, int i) {
    return Single<true>::children(node)[i];
  }
  static unsigned boxes(const std::byte* node) { return Single<true>::boxes(node); }
};

template <int N>
void add_kernels(std::type_identity<bvh::WideBvh<bvh_quantised::QuantisedNodes<N>>>, KernelRows& rows) {
  using Structure = bvh::WideBvh<bvh_quantised::QuantisedNodes<N>>;
  using Packets = BvhPacketFamily<QuantisedPacketNodes<N>>;
  using Queue = BvhNodeQueue<QuantisedTests<N>::template Nodes>;
  using Single = typename BvhSingle<QuantisedTests<N>::template Nodes>::Functions;
  add_rows<Structure, Single>(rows, "single", UsualLeaves{});
  add_queued_rows<Structure, Queue::template Of, Single>(rows, BatchLeaves{});
  add_packet_rows<Structure, Packets>(rows, TypeList<>{});
  using Incoherent = IncoherentInFlight<Queue::template Of, Single, N>;
  add_rows<Structure, AutoFunctions<Packets, TypeList<>, Incoherent, Single, false>>(rows, "auto", BatchLeaves{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
