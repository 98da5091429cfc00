// What `watertight` and `exact` keep for a ray: its axes in an order in which the direction is largest along the last,
// and the constants that shear triangles so that the ray is that axis (Woop, Benthin, Wald, JCGT 2(1) 2013). Found
// without a branch, since the axis of a secondary ray cannot be foretold, and kept in memory, from where a lane's worth
// is loaded as cheaply as a register is copied.
#pragma once

#include "simd/swizzle.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Axes x, y, z of which the last is `axis`, the others following in turn.
struct AxisOrder {
  alignas(32) std::uint8_t bytes[16];  ///< of four floats x y z w, where each comes from
  std::uint32_t x, y, z, unused;       ///< 16 times the axes

  static constexpr AxisOrder of(unsigned axis) {
    AxisOrder order{};
    const unsigned from[4] = {(axis + 1) % 3, (axis + 2) % 3, axis, 3};
    for (unsigned i = 0; i < 16; ++i) order.bytes[i] = std::uint8_t(4 * from[i / 4] + i % 4);
    order.x = 16 * from[0], order.y = 16 * from[1], order.z = 16 * from[2];
    return order;
  }
  ARBORETUM_INLINE vf<4> operator()(vf<4> a) const {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
    return vf<4>::map([&](int i) { return a.lane[bytes[4 * i] / 4]; });
#else
    return vf<4>(_mm_castsi128_ps(
        _mm_shuffle_epi8(_mm_castps_si128(a.v), _mm_load_si128(reinterpret_cast<const __m128i*>(bytes)))));
#endif
  }
};
inline constexpr AxisOrder kAxisOrders[3] = {AxisOrder::of(0), AxisOrder::of(1), AxisOrder::of(2)};

/// The order for the axis along which |direction| is largest; of equal ones the last, but x, y and z alike: z.
ARBORETUM_INLINE const AxisOrder& largest_last(vf<4> direction) {
  // By whether x > y, x > z and y > z; two of the eight cannot be.
  static constexpr AxisOrder kOrders[8] = {AxisOrder::of(2), AxisOrder::of(2), AxisOrder::of(2), AxisOrder::of(0),
                                           AxisOrder::of(1), AxisOrder::of(2), AxisOrder::of(1), AxisOrder::of(0)};
  const vf<4> size = abs(direction);
  return kOrders[(permute_in_fours<0, 0, 1, 3>(size) > permute_in_fours<1, 2, 2, 3>(size)).bits()];
}

struct ShearedRay {
  alignas(16) float from[4];   ///< the origin; tnear
  alignas(16) float shear[4];  ///< dx/dz, dy/dz, -1/dz
  alignas(16) float direction[4];
  const AxisOrder* order;

  ARBORETUM_INLINE explicit ShearedRay(const Ray& ray) : ShearedRay(ray, largest_last(vf<4>::load(&ray.direction))) {
    const vf<4> d = vf<4>::load(direction);
    (minus_one_for_z(d) / permute_in_fours<2, 2, 2, 2>(d)).store(shear);
  }
  /// With shear constants known.
  ARBORETUM_INLINE ShearedRay(const Ray& ray, unsigned axis, float shear_x, float shear_y, float shear_z)
      : ShearedRay(ray, kAxisOrders[axis]) {
    shear[0] = shear_x, shear[1] = shear_y, shear[2] = shear_z;
  }

  /// The same, but the compiler does not know: it would copy every number into a vector of its own on the stack, and
  /// load it from there. 32 registers (AVX-512) hold them; SSE has no load that copies.
  [[nodiscard]] ARBORETUM_INLINE const ShearedRay& in_memory() const {
    const ShearedRay* p = this;
#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX2
    asm("" : "+r"(p));
#endif
    return *p;
  }
  [[nodiscard]] ARBORETUM_INLINE float tnear() const { return from[3]; }
  /// Row of a block's coordinates along an axis, x, y or z of an AxisOrder.
  template <int W>
  [[nodiscard]] static ARBORETUM_INLINE const float* row(const float (&p)[3][W], std::uint32_t axis) {
    return reinterpret_cast<const float*>(reinterpret_cast<const std::byte*>(p) +
                                          (W < 4 ? std::size_t(axis) / (4 / W) : std::size_t(axis) * (W / 4)));
  }

 private:
  ARBORETUM_INLINE ShearedRay(const Ray& ray, const AxisOrder& axes) : order(&axes) {
    axes(vf<4>::load(&ray.origin)).store(from);
    axes(vf<4>::load(&ray.direction)).store(direction);
  }
  static ARBORETUM_INLINE vf<4> minus_one_for_z(vf<4> d) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
    d.lane[2] = -1.0f;
    return d;
#else
    return vf<4>(_mm_blend_ps(d.v, _mm_set1_ps(-1.0f), 4));
#endif
  }
};

/// The three vertices of a block's triangles, sheared: x and y so that the ray is the z axis, z along it. All with
/// their signs turned, as the origin is seen from them, since the origin is in a register and they are in memory;
/// products of two of them are what they would be, and a product with -1/dz is a distance.
template <int W>
struct ShearedVertices {
  using F = vf<W>;
  vf3<W> a, b, c;

  template <class Block>
  ARBORETUM_INLINE ShearedVertices(const ShearedRay& ray, const Block& block) {
    const F ox(ray.from[0]), oy(ray.from[1]), oz(ray.from[2]), sx(ray.shear[0]), sy(ray.shear[1]);
    const AxisOrder& axes = *ray.order;
    const auto shear = [&](const float(&p)[3][W]) {
      const F pz = oz - F::load(ShearedRay::row(p, axes.z));
      return vf3<W>{nmadd(sx, pz, ox - F::load(ShearedRay::row(p, axes.x))),
                    nmadd(sy, pz, oy - F::load(ShearedRay::row(p, axes.y))), pz};
    };
    a = shear(block.v0), b = shear(block.v1), c = shear(block.v2);
  }
#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX512
  /// A block of eight as one ray sees it, in the lower half of the lanes, and as another does, in the upper.
  template <class Block>
  ARBORETUM_INLINE ShearedVertices(const ShearedRay& low, const ShearedRay& high,
                                   const Block& block) requires(W == 16) {
    const auto number = [](const float(&of_low)[4], const float(&of_high)[4], int i) {
      return in_halves(of_low[i], of_high[i]);
    };
    const F ox = number(low.from, high.from, 0), oy = number(low.from, high.from, 1),
            oz = number(low.from, high.from, 2), sx = number(low.shear, high.shear, 0),
            sy = number(low.shear, high.shear, 1);
    const AxisOrder &one = *low.order, &other = *high.order;
    const auto shear = [&](const float(&p)[3][8]) {
      const auto row = [&p](std::uint32_t of_low, std::uint32_t of_high) {
        return in_halves(vf<8>::load(ShearedRay::row(p, of_low)), vf<8>::load(ShearedRay::row(p, of_high)));
      };
      const F pz = oz - row(one.z, other.z);
      return vf3<W>{nmadd(sx, pz, ox - row(one.x, other.x)), nmadd(sy, pz, oy - row(one.y, other.y)), pz};
    };
    a = shear(block.v0), b = shear(block.v1), c = shear(block.v2);
  }
#endif
  /// Of one ray a lane: points as their origins are seen from them.
  ARBORETUM_INLINE ShearedVertices(F sx, F sy, vf3<W> p0, vf3<W> p1, vf3<W> p2) {
    const auto shear = [&](vf3<W> p) { return vf3<W>{nmadd(sx, p.z, p.x), nmadd(sy, p.z, p.y), p.z}; };
    a = shear(p0), b = shear(p1), c = shear(p2);
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
