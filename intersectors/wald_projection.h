// Wald's projection test (thesis 2004, 7.1.1; after Badouel, Graphics Gems 1990): the triangle is projected along the
// axis on which its normal is largest. Three numbers give its plane, solved for that axis, and so t; three each give u
// and v of the hit's other two coordinates. The paper branches over the axis; here each lane selects its axes of the
// ray. 40 bytes a triangle, the least of the precomputed forms.
//
// Leaks along edges, most of all where neighbours project along different axes; t is off by no more than
// 2^-21 (|o| + |v0| + |t d|) / (|N.d| / |N|max), sums of absolute components meant. Precise near the origin alone.
#pragma once

#include "intersectors/triangle_hits.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

struct WaldProjection {
  static constexpr std::string_view kName = "wald_projection";
  static constexpr bool reads(TriangleForm form) { return form == TriangleForm::projection; }
  static constexpr bool kEveryLeaf = true;

  /// x y z x y: the axis's own component and the next two start at the axis.
  struct RayData {
    float origin[5], direction[5];
    ARBORETUM_INLINE explicit RayData(const Ray& ray)
        : origin{ray.origin.x, ray.origin.y, ray.origin.z, ray.origin.x, ray.origin.y}, direction{ray.direction.x,
                                                                                                  ray.direction.y,
                                                                                                  ray.direction.z,
                                                                                                  ray.direction.x,
                                                                                                  ray.direction.y} {}
  };

  template <class Block>
  static ARBORETUM_INLINE auto intersect(const RayData& ray, const Block& block, TriangleHits<Block::kWidth>& hits) {
    constexpr int W = Block::kWidth;
    using F = vf<W>;
    const auto number = [&block](int i) { return F::load(block.number[i]); };
    const vf3<W> o = turned<W>(ray.origin, block.axis), d = turned<W>(ray.direction, block.axis);
    const F nu = number(0), nv = number(1);
    // A line in the plane, or in one parallel to it, makes t infinite or NaN, and the point with it: not inside.
    const F t = (number(2) - madd(nu, o.y, madd(nv, o.z, o.x))) / madd(nu, d.y, madd(nv, d.z, d.x));
    const F y = madd(t, d.y, o.y), z = madd(t, d.z, o.z);
    const F u = madd(number(3), y, madd(number(4), z, number(5))),
            v = madd(number(6), y, madd(number(7), z, number(8)));
    hits = {t, u, v, F(1.0f)};
    return (u >= F(0.0f)) & (v >= F(0.0f)) & (u + v <= F(1.0f));
  }

 private:
  /// Each lane's component along its axis, and those along the next two.
  template <int W>
  static ARBORETUM_INLINE vf3<W> turned(const float (&p)[5], const std::int32_t* axis) {
    if constexpr (W == 1) {
      return {p[*axis], p[*axis + 1], p[*axis + 2]};
    } else {
      const vi<W> k = vi<W>::load(axis);
      const vm<W> first = k == vi<W>(0), second = k == vi<W>(1);
      const vf<W> x(p[0]), y(p[1]), z(p[2]);
      return {select(first, x, select(second, y, z)), select(first, y, select(second, z, x)),
              select(first, z, select(second, x, y))};
    }
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
