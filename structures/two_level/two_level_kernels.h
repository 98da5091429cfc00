// One ray through two levels: the top's boxes in world space, then for each instance the boxes of the structure below
// in object space, with the ray mapped there, and the triangles in its leaves in world space again, as the flat mesh
// has them (placed_leaves_single.h). The direction is mapped without being normalised, so t keeps its meaning. What is
// hit, and where, is thus decided as in a structure over the flat mesh, by the same operations on the same numbers, bit
// for bit; only which boxes are visited is decided in object space, and there padded boxes lose nothing:
//
// u = 2^-24. An instance maps x to L x + T, its stored inverse w to A(w) = R w + c; |.| is the largest |component|, of
// a linear part the largest row sum; M the prototype's largest |coordinate|, o, d the world-space ray, o*, d* its exact
// image under A, o', d' that rounded to float. Let a triangle be hit at t.
// - An intersector that promises something answers t such that o + t d is within 20 u D of a point Q = sum l_k w_k of
//   the flat triangle, l_k >= 0, sum l_k = 1, D the largest |w_k - o|: it works on corners as seen from the origin, and
//   rounds shears, weights and t by less (exact_filter.h has 4.5 to 5.5 u D across the ray, 10 u D along it). Not so
//   `watertight` where it sees a triangle edge on, to within its rounding: t is then anywhere between the corners'. Such
//   hits boxes may lose in any structure, and no promise is about them. A takes this to 20 u |R| D, and
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
// A box test's own roundings are 5.1 u (M + |o'_i|) at most (box_test.h, bvh_quantised_kernels.h, kdtree_single.h), its
// pad for a largest coordinate of M + P is 8 u (M + P + |o'_i|), and so with P = p / 8 u
//   5.1 u (M + |o'_i|) + 1.1 u (M + 2 |o'_i|) + p < 8 u (M + P + |o'_i|):
// the box is met, within any interval that holds t. P is Placed::pad + Placed::pad_per_distance |o'|, both rounded up,
// pad_per_distance = 4.01 k. The top's boxes hold the flat mesh's corners, and the ray is itself there.
#pragma once

#include "structures/two_level/placed_search_single.h"
#include "traversal/kernel_rows.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// The kernels of the structure below that a row stands for.
[[nodiscard]] inline const KernelRow& row_below(const two_level::TwoLevel& accel, const KernelRow& above) {
  const KernelRow* row = find_kernel(accel.below(), accel.leaf(), above.intersector, above.box, "single", kIsa);
  if (!row) {
    throw UserError("two_level over " + accel.below() + ": " +
                    why_no_kernel(accel.below(), accel.leaf(), above.intersector, above.box, "single", kIsa));
  }
  return *row;
}

/// The structure below knows its leaves.
template <class, bool Padded, class Counting>
class TwoLevelKernel {
 public:
  TwoLevelKernel(const Accel& accel, const KernelRow& row, Counting counting)
      : accel_(static_cast<const two_level::TwoLevel&>(accel)), counting_(counting),
        stack_(accel_.top().stack_entries()), leaves_(*row_below(accel_, row).tests, accel_.mesh()),
        closest_(find_search<false, Padded, Counting>(accel_.below())),
        any_(find_search<true, Padded, Counting>(accel_.below())) {}

  template <bool AnyHit>
  bool trace(const Ray& ray, float /*time*/, NearestHit& best) {
    const bvh::Bvh4& top = accel_.top();
    SoaNodeTest<4, true> nodes(ray, top.max_coordinate());
    leaves_.begin(ray);
    const bool over = walk_bvh<false>(
        top.base(), top.root(), nodes, stack_.data(), best.t, counting_, [&](bvh::NodeReference reference) {
          const auto& block = *reinterpret_cast<const IndexBlock<1>*>(top.base() + bvh::offset_of(reference));
          const two_level::Placed& instance = accel_.placed()[block.id[0]];
          leaves_.enter(instance);
          const PlacedRay placed(ray, instance, best.t);
          const bool found = (AnyHit ? any_ : closest_)(*instance.below, placed, leaves_, best, counting_);
          nodes.shorten(best.t);
          return AnyHit && found;
        });
    if constexpr (!AnyHit) leaves_.finish(best);
    return over;
  }

 private:
  const two_level::TwoLevel& accel_;
  Counting counting_;
  TraversalStack stack_;
  PlacedLeaves leaves_;
  PlacedSearch<Counting> closest_, any_;
};

/// Which rows the structure below has is asked when a cell is planned. A scene without instances is the structure
/// below: it gets the batch as it is.
struct TwoLevelFunctions {
  template <class Counting, bool Padded>
  struct Rays : SingleRays<TwoLevelKernel<CalledLeaves, Padded, Counting>, Counting> {
    using Base = SingleRays<TwoLevelKernel<CalledLeaves, Padded, Counting>, Counting>;
    static void closest_hit(const Accel& accel, const KernelRow& row, RayBatch rays, std::span<Hit> hits,
                            Counters* counters) {
      const auto& two = static_cast<const two_level::TwoLevel&>(accel);
      if (const Accel* below = two.only()) return row_below(two, row).closest_hit(*below, rays, hits, counters);
      Base::closest_hit(accel, row, rays, hits, counters);
    }
    static void any_hit(const Accel& accel, const KernelRow& row, RayBatch rays, std::span<std::uint8_t> occluded,
                        Counters* counters) {
      const auto& two = static_cast<const two_level::TwoLevel&>(accel);
      if (const Accel* below = two.only()) return row_below(two, row).any_hit(*below, rays, occluded, counters);
      Base::any_hit(accel, row, rays, occluded, counters);
    }
  };
  template <class, bool Padded>
  static RowFunctions timed() {
    return {&Rays<NoCounters, Padded>::closest_hit, &Rays<NoCounters, Padded>::any_hit};
  }
  template <bool Padded>
  static RowFunctions counting() {
    return {&Rays<WithCounters, Padded>::closest_hit, &Rays<WithCounters, Padded>::any_hit};
  }
};

inline void add_kernels(std::type_identity<two_level::TwoLevel>, KernelRows& rows) {
  add_rows<two_level::TwoLevel, TwoLevelFunctions>(rows, "single", TypeList<>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
