// One ray through two levels: the top's boxes in world space, then for each instance the ray in object space, by the
// kernel of the structure below: one indirect call an instance. The direction is mapped without being normalised, so t
// keeps its meaning.
//
// Object space rounds: the mapped ray is off by 2^-24 of its own numbers. Three things come of it.
// - The top's boxes are padded for it. A hit's point p lies on the object-space triangle; in world space it is off the
//   exact ray by |L| |eta + t zeta|, where eta and zeta are the roundings of origin and direction: at most
//     u (2|o'| + |p'|) for u = 2^-24, and so
//     u k (2|o| + |p| + 3|T|) with k = || |L||L^-1| || and T the translation.
//   The pad of box_test.h for a largest coordinate of
//     reach + k (|o| + reach), reach = M + 2|T|,
//   is more than its own need and this together (8 u of it against 4 u of M + |o|, and 3 u at most of k (...)).
// - t, u and v of the winner are computed again from the flat mesh's vertices with the same test, so that they are
//   those of a structure over the flat mesh, bit for bit, wherever both find the same triangle. Where the test misses
//   the flat triangle (the ray meets its edge) t is that of its plane, in double.
// - A t close to an end of the interval may lie on the other side of it in world space, as on the surface that a
//   secondary ray starts from. There the t in world space decides, and the search goes on behind a hit that is refused.
#pragma once

#include "structures/bvh/bvh_single.h"
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

/// The structure below knows its leaves, and the row there its box test.
template <class, bool, class Counting>
class TwoLevelKernel {
 public:
  TwoLevelKernel(const Accel& accel, const KernelRow& row, Counting counting)
      : accel_(static_cast<const two_level::TwoLevel&>(accel)), row_(row_below(accel_, row)), counting_(counting),
        stack_(accel_.top().stack_entries()) {
    const LeafTests* alone = find_leaf_tests(VertexBlock<1>::kName, row.intersector, kIsa);
    tests_ = alone ? alone : row.tests;
  }

  template <bool AnyHit>
  bool trace(const Ray& ray, float /*time*/, NearestHit& nearest_hit) {
    Hit best;
    float nearest = ray.tfar;
    const float origin = largest_component(ray.origin), k = accel_.magnification();
    SoaNodeTest<4, true> nodes(ray, accel_.reach() + k * (origin + accel_.reach()));
    const bvh::Bvh4& top = accel_.top();
    walk_bvh<false>(
        top.base(), top.root(), nodes, stack_.data(), nearest, counting_, [&](bvh::NodeReference reference) {
          const auto& block = *reinterpret_cast<const IndexBlock<1>*>(top.base() + bvh::offset_of(reference));
          const bool over = visit<AnyHit>(ray, accel_.placed()[block.id[0]], nearest, best);
          nodes.shorten(nearest);
          return over;
        });
    if (best.is_hit()) nearest_hit = {best.t, best.u, best.v, std::int32_t(best.primitive)};
    return best.is_hit();
  }

 private:
  /// Returns true when the search is over. `nearest` may stay above best.t, so that an equal hit of a lower id is not
  /// lost.
  template <bool AnyHit>
  bool visit(const Ray& ray, const two_level::Placed& instance, float& nearest, Hit& best) {
    if (instance.identity) {
      Ray clipped = ray;
      clipped.tfar = nearest;
      if constexpr (AnyHit) {
        if (any_below(instance, clipped)) best.primitive = instance.first_primitive;
        return best.is_hit();
      }
      Hit hit = closest_below(instance, clipped);
      if (hit.is_hit()) {
        hit.primitive += instance.first_primitive;
        offer(hit, hit.t, nearest, best);
      }
      return false;
    }
    Ray mapped;
    mapped.origin = transform_point(instance.to_object, ray.origin);
    mapped.direction = transform_direction(instance.to_object, ray.direction);
    const float slack =
        0x1p-20f * (largest_component(mapped.origin) + instance.max_coordinate) / largest_component(mapped.direction);
    const float doubt = 0x1p10f * slack;  // within it of an end of the interval, world space decides
    const float last = best.is_hit() ? nearest : ray.tfar + slack;
    mapped.tnear = ray.tnear > slack ? ray.tnear - slack : 0.0f;
    if constexpr (AnyHit) {
      mapped.tnear = ray.tnear + doubt, mapped.tfar = ray.tfar - doubt;
      if (mapped.tnear <= mapped.tfar && any_below(instance, mapped)) {
        best.primitive = instance.first_primitive;
        return true;
      }
      mapped.tnear = ray.tnear > slack ? ray.tnear - slack : 0.0f;
      mapped.tfar = ray.tnear + doubt < last ? ray.tnear + doubt : last;
      if (first_accepted(ray, instance, mapped, doubt, nearest, best)) return true;
      if (!(ray.tfar < std::numeric_limits<float>::infinity())) return false;
      mapped.tnear = mapped.tfar > ray.tfar - doubt ? mapped.tfar : ray.tfar - doubt, mapped.tfar = last;
      return first_accepted(ray, instance, mapped, doubt, nearest, best);
    }
    mapped.tfar = last;
    first_accepted(ray, instance, mapped, doubt, nearest, best);
    return false;
  }

  /// The first hit of the mapped ray that holds in world space.
  bool first_accepted(const Ray& ray, const two_level::Placed& instance, Ray& mapped, float doubt, float& nearest,
                      Hit& best) {
    while (mapped.tnear <= mapped.tfar) {
      const Hit object = closest_below(instance, mapped);
      if (!object.is_hit()) return false;
      Hit world = in_world(ray, object, object.primitive + instance.first_primitive);
      const bool holds = world.t >= ray.tnear && world.t <= ray.tfar;
      if (holds || (object.t >= ray.tnear + doubt && object.t <= ray.tfar - doubt)) {
        if (!holds) world.t = object.t;
        offer(world, object.t, nearest, best);
        return true;
      }
      mapped.tnear = std::nextafter(object.t, std::numeric_limits<float>::infinity());
    }
    return false;
  }

  static void offer(const Hit& hit, float object_t, float& nearest, Hit& best) {
    if (!(hit.t < best.t || (hit.t == best.t && hit.primitive < best.primitive))) return;
    best = hit;
    nearest = object_t > hit.t ? object_t : hit.t;
  }

  /// The hit as the flat mesh's triangle has it.
  Hit in_world(const Ray& ray, const Hit& object, std::uint32_t primitive) const {
    PreparedRay data;
    tests_->prepare(ray, data);
    alignas(64) std::byte block[kLargestBlock];
    tests_->form->fill(block, accel_.mesh(), {&primitive, 1});
    NearestHit flat{std::numeric_limits<float>::infinity()};
    if (tests_->closest_hit(data, block, 1, accel_.mesh().vertices.data(), -std::numeric_limits<float>::infinity(),
                            flat)) {
      if (tests_->finish) tests_->finish(data, flat);
      return {flat.t, flat.u, flat.v, primitive};
    }
    const std::array<Vec3f, 3> corner = accel_.mesh().corners(primitive);
    double a[3], e1[3], e2[3], d[3];
    for (unsigned i = 0; i < 3; ++i) {
      const double v0 = corner[0][i];
      a[i] = v0 - ray.origin[i], e1[i] = corner[1][i] - v0, e2[i] = corner[2][i] - v0, d[i] = ray.direction[i];
    }
    const double n[3] = {e1[1] * e2[2] - e1[2] * e2[1], e1[2] * e2[0] - e1[0] * e2[2], e1[0] * e2[1] - e1[1] * e2[0]};
    const double along = n[0] * d[0] + n[1] * d[1] + n[2] * d[2];
    const auto t = float((n[0] * a[0] + n[1] * a[1] + n[2] * a[2]) / along);
    return {__builtin_isfinite(t) ? t : object.t, object.u, object.v, primitive};
  }

  Hit closest_below(const two_level::Placed& instance, const Ray& ray) {
    Hit hit;
    below([&](Counters* counters) { row_.closest_hit(*instance.below, RayBatch(&ray, 1), {&hit, 1}, counters); });
    return hit;
  }
  bool any_below(const two_level::Placed& instance, const Ray& ray) {
    std::uint8_t occluded = 0;
    below([&](Counters* counters) { row_.any_hit(*instance.below, RayBatch(&ray, 1), {&occluded, 1}, counters); });
    return occluded != 0;
  }
  /// The batch counts its rays; those that go below are not rays more.
  template <class Trace>
  void below(const Trace& trace) {
    if constexpr (Counting::kCounting) {
      const std::uint64_t rays = counting_.counters.rays;
      trace(&counting_.counters);
      counting_.counters.rays = rays;
    } else {
      trace(nullptr);
    }
  }

  const two_level::TwoLevel& accel_;
  const KernelRow& row_;
  const LeafTests* tests_;
  Counting counting_;
  TraversalStack stack_;
};

/// One set of functions for all rows. Which rows the structure below has is asked when a cell is planned.
struct TwoLevelFunctions {
  template <class, bool>
  static RowFunctions timed() {
    return SingleRayFunctions<TwoLevelKernel>::timed<CalledLeaves, true>();
  }
  template <bool>
  static RowFunctions counting() {
    return SingleRayFunctions<TwoLevelKernel>::counting<true>();
  }
};

inline void add_kernels(std::type_identity<two_level::TwoLevel>, KernelRows& rows) {
  add_rows<two_level::TwoLevel, TwoLevelFunctions>(rows, "single", TypeList<>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
