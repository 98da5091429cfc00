// Rays through two levels, alone or in packets: the top's boxes in world space, then for each instance the boxes of the
// structure below in object space, with the rays mapped there, and the triangles in its leaves in world space again, as
// the flat mesh has them (placed_leaves_single.h). The direction is mapped without being normalised, so t keeps its
// meaning. What is hit, and where, is thus decided as in a structure over the flat mesh, by the same operations on the
// same numbers, bit for bit; only which boxes are visited is decided in object space, and there padded boxes lose
// nothing:
//
// u = 2^-24. An instance maps x to L x + T, its stored inverse w to A(w) = R w + c; |.| is the largest |component|, of
// a linear part the largest row sum; M the prototype's largest |coordinate|, o, d the world-space ray, o*, d* its exact
// image under A, o', d' that rounded to float. Let a triangle be hit at t.
// - An intersector that promises something answers t such that o + t d is within 20 u D of a point Q = sum l_k w_k of
//   the flat triangle, l_k >= 0, sum l_k = 1, D the largest |w_k - o|: it works on corners as seen from the origin, and
//   rounds shears, weights and t by less (exact_filter.h has 4.5 to 5.5 u D across the ray, 10 u D along it). Not so
//   `watertight` close to tnear where it sees a triangle edge on, to within its rounding: t is then within the box that
//   its corners have in world space, and no promise is about it. A takes this to 20 u |R| D, and
//   D <= |L| |A(w_k) - o*| (1 + 2^-9) where |L R - 1| <= 2^-10, so to less than 20.1 u k (M + |o*|) for k = |R||L|, and
//   what the mismatch below adds times k u.
// - A(w_k) is not the prototype's corner v_k. The flat mesh rounds, by 2^-23 of |L| M + |T| (2^-20 where it is not what
//   transform_point() makes: check_instances()), and R and c are no exact inverse. So A(w_k) is off by at most
//     m = |R L - 1| M + |R T + c| + |R| (2^-23 (|L| M + |T|)),
//   and A(Q) within m of a point of the prototype's triangle, which is in its boxes and cells.
// - o' and d' are off by u |o'_i|, u |d'_i| and, from doubles, by 2^-51 (|R||o| + |c|), 2^-51 |R||d|; what underflow
//   adds to d' is below 2^-50 of |d'|, which is at least 2^-100. With t |d'_i| <= M + |o'_i| and t |d| <= D, and all the
//   rest below, these move the ray's point at t along axis i by less than
//     1.1 u (M + 2 |o'_i|) + 2^-48 (k (M + |o'|) + |R||T| + |c|).
// So at t the mapped ray is, along axis i, within 1.1 u (M + 2 |o'_i|) + p of the box, where
//   p = 32 u k (M + |o'|) + 1.01 m + 2^-45 (|R||T| + |c|).
// A box test's own roundings are 5.1 u (M + |o'_i|) at most (box_test.h, kdtree_single.h), its
// pad for a largest coordinate of M + P is 8 u (M + P + |o'_i|), and so with P = p / 8 u
//   5.1 u (M + |o'_i|) + 1.1 u (M + 2 |o'_i|) + p < 8 u (M + P + |o'_i|):
// the box is met, within any interval that holds t. (Where the structure below is made for less than M, its boxes are
// wider by more than the difference's 8 u: structures/box_pads.h.) P is Placed::pad + Placed::pad_per_distance |o'|,
// both rounded up, pad_per_distance = 4.01 k. The top's boxes hold the flat mesh's corners, and the ray is itself
// there. In a packet all rays have the largest pad of theirs.
#pragma once

#include "structures/two_level/instances_kernels.h"
#include "traversal/auto_rows.h"
#include "traversal/kernel_rows.h"
#include "traversal/packet_rows.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Single rays: the top's boxes are padded whatever those below are.
template <class, bool, class Counting>
class TwoLevelKernel
    : public BvhSingle<SoaTests<4>::Nodes>::Kernel<InstanceLeaves<Counting>, true, TopCounting<Counting>> {
  using Base =
      typename BvhSingle<SoaTests<4>::Nodes>::template Kernel<InstanceLeaves<Counting>, true, TopCounting<Counting>>;

 public:
  TwoLevelKernel(const Accel& accel, const KernelRow& row, Counting counting)
      : TwoLevelKernel(static_cast<const two_level::TwoLevel&>(accel), row, counting) {}

 private:
  TwoLevelKernel(const two_level::TwoLevel& accel, const KernelRow& row, Counting counting)
      : Base(accel.top(), row, TopCounting<Counting>(counting), InstanceLeaves<Counting>(accel, row, counting)) {}
};

/// As traversal/packet_rows.h wants it. What of a packet goes into an instance counts as a packet of its own.
struct TwoLevelPacketFamily {
  using Structure = two_level::TwoLevel;
  static constexpr bool kFewerLanes = false;
  /// All but those that start anywhere: neighbours in a picture that trees stand in are far apart, too.
  static constexpr float kNear = kRegisterWidth == 1 ? 0.0f : 0.5f;

  template <int W, class, bool AnyHit, class Counting>
  class Packets {
   public:
    Packets(const Structure& accel, const KernelRow& row, Counting counting)
        : top_(accel.top(), row, TopCounting<Counting>(counting),
               InstanceLeaves<Counting>(accel, row, counting, find_packets<W, AnyHit, Counting>(accel.below()), group_),
               true, accel.top().max_coordinate()) {}

    void set_size(int rays_each) { top_.set_size(rays_each); }
    void set_width(unsigned width) requires Counting::kCounting { top_.set_width(width); }
    void trace(const RayBatch& rays, int threshold) { group_.threshold = threshold, top_.trace(rays, threshold); }
    [[nodiscard]] const NearestHit& best(int i) const { return top_.best(i); }
    [[nodiscard]] std::size_t times_alone() const { return top_.times_alone(); }

   private:
    PlacedGroup group_;
    BvhPackets<SoaPacketNodes<4>, W, InstanceLeaves<Counting>, AnyHit, TopCounting<Counting>> top_;
  };
};

/// The kernels of the structure below that a row stands for.
[[nodiscard]] inline const KernelRow& row_below(const two_level::TwoLevel& accel, const KernelRow& above) {
  const KernelRow* row = find_kernel(accel.below(), accel.leaf(), above.intersector, above.box, above.traversal, kIsa);
  if (!row) {
    throw UserError("two_level over " + accel.below() + ": " +
                    why_no_kernel(accel.below(), accel.leaf(), above.intersector, above.box, above.traversal, kIsa));
  }
  return *row;
}

/// A scene without instances is the structure below: it gets the batch as it is. Which rows it has is asked before:
/// when a cell is planned, when a program makes a Tracer.
template <class Functions>
struct OrBelow {
  template <RowFunctions (*Of)()>
  struct Rows {
    static void closest_hit(const Accel& accel, const KernelRow& row, RayBatch rays, std::span<Hit> hits,
                            Counters* counters) {
      const auto& two = static_cast<const two_level::TwoLevel&>(accel);
      if (const Accel* below = two.only()) return row_below(two, row).closest_hit(*below, rays, hits, counters);
      Of().closest_hit(accel, row, rays, hits, counters);
    }
    static void any_hit(const Accel& accel, const KernelRow& row, RayBatch rays, std::span<std::uint8_t> occluded,
                        Counters* counters) {
      const auto& two = static_cast<const two_level::TwoLevel&>(accel);
      if (const Accel* below = two.only()) return row_below(two, row).any_hit(*below, rays, occluded, counters);
      Of().any_hit(accel, row, rays, occluded, counters);
    }
  };
  template <class Leaves, bool Padded>
  static RowFunctions timed() {
    using R = Rows<&Functions::template timed<Leaves, Padded>>;
    return {&R::closest_hit, &R::any_hit};
  }
  template <bool Padded>
  static RowFunctions counting() {
    using R = Rows<&Functions::template counting<Padded>>;
    return {&R::closest_hit, &R::any_hit};
  }
};

inline void add_kernels(std::type_identity<two_level::TwoLevel>, KernelRows& rows) {
  using Structure = two_level::TwoLevel;
  using Single = SingleRayFunctions<TwoLevelKernel>;
  add_rows<Structure, OrBelow<Single>>(rows, "single", TypeList<>{});
  add_packet_rows<Structure, TwoLevelPacketFamily, OrBelow>(rows, TypeList<>{});
  // Small packets map an instance's leaves for several rays at once: worth while for rays that share little, too, where
  // a register holds eight (docs/performance/other-structures.md).
  using Hybrid = PacketFunctions<TwoLevelPacketFamily, 16, kFewOfHybrid16>;
  using Incoherent = std::conditional_t<(kRegisterWidth >= 8), Hybrid, Single>;
  constexpr AutoLimits limits{.near_closest = 1350, .near_any = 600};
  using Auto = AutoFunctions<TwoLevelPacketFamily, TypeList<>, limits, Incoherent, Single>;
  add_rows<Structure, OrBelow<Auto>>(rows, "auto", TypeList<>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
