// What `watertight` and `exact` keep for a ray: its axes in an order in which the direction is largest along the last, and the constants that
// shear triangles so that the ray is that axis (Woop, Benthin, Wald, JCGT 2(1) 2013). Found without a branch, since the axis of a
// secondary ray cannot be foretold, and kept in memory, from where a lane's worth is loaded as cheaply as a register is copied.
#pragma once

#include "simd/swizzle.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Axes x, y, z of which the last is `axis`, the others following in turn.
struct AxisOrder {
  alignas(16) std::uint8_t bytes[16];  ///< of four floats x y z w, where each comes from
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
    return vf<4>(_mm_castsi128_ps(_mm_shuffle_epi8(_mm_castps_si128(a.v), _mm_load_si128(reinterpret_cast<const __m128i*>(bytes)))));
#endif
  }
};
inline constexpr AxisOrder kAxisOrders[3] = {AxisOrder::of(0), AxisOrder::of(1), AxisOrder::of(2)};

/// The axis along which |direction| is largest; of equal ones the last, but x, y and z alike: z.
ARBORETUM_INLINE unsigned largest_axis(vf<4> direction) {
  const vf<4> size = abs(direction);
  const unsigned x_y_x_z_y_z = (permute_in_fours<0, 0, 1, 1>(size) > permute_in_fours<1, 2, 2, 2>(size)).bits() & 7u;
  constexpr unsigned kAxes = 2u | 2u << 2 | 2u << 4 | 0u << 6 | 1u << 8 | 2u << 10 | 1u << 12 | 0u << 14;
  return kAxes >> 2 * x_y_x_z_y_z & 3u;
}

struct ShearedRay {
  alignas(16) float back[4];       ///< the origin with its signs turned: a block's coordinates are then added from memory; tnear, turned
  alignas(16) float shear[4];      ///< dx/dz, dy/dz, 1/dz
  alignas(16) float direction[4];
  std::uint32_t x, y, z;           ///< 16 times the axes

  ARBORETUM_INLINE explicit ShearedRay(const Ray& ray) : ShearedRay(ray, largest_axis(vf<4>::load(&ray.direction))) {
    const vf<4> d = vf<4>::load(direction);
    (one_for_z(d) / permute_in_fours<2, 2, 2, 2>(d)).store(shear);
  }
  /// With shear constants known.
  ARBORETUM_INLINE ShearedRay(const Ray& ray, unsigned axis, float shear_x, float shear_y, float shear_z) : ShearedRay(ray, axis) {
    shear[0] = shear_x, shear[1] = shear_y, shear[2] = shear_z;
  }

  /// The same, but the compiler does not know: it would copy every number into a vector of its own on the stack, and load it from there. 32 registers
  /// (AVX-512) hold them; SSE has no load that copies.
  [[nodiscard]] ARBORETUM_INLINE const ShearedRay& in_memory() const {
    const ShearedRay* p = this;
#if ARBORETUM_TARGET == ARBORETUM_TARGET_AVX2
    asm("" : "+r"(p));
#endif
    return *p;
  }
  [[nodiscard]] ARBORETUM_INLINE float tnear() const { return -back[3]; }
  /// Row of a block's coordinates along an axis, x, y or z.
  template <int W>
  [[nodiscard]] static ARBORETUM_INLINE const float* row(const float (&p)[3][W], std::uint32_t axis) {
    return reinterpret_cast<const float*>(reinterpret_cast<const std::byte*>(p) + (W < 4 ? axis / (4 / W) : axis * (W / 4)));
  }

 private:
  ARBORETUM_INLINE ShearedRay(const Ray& ray, unsigned axis) {
    const AxisOrder& order = kAxisOrders[axis];
    (-order(vf<4>::load(&ray.origin))).store(back);
    order(vf<4>::load(&ray.direction)).store(direction);
    x = order.x, y = order.y, z = order.z;
  }
  static ARBORETUM_INLINE vf<4> one_for_z(vf<4> d) {
#if ARBORETUM_TARGET == ARBORETUM_TARGET_SCALAR
    d.lane[2] = 1.0f;
    return d;
#else
    return vf<4>(_mm_blend_ps(d.v, _mm_set1_ps(1.0f), 4));
#endif
  }
};

/// The three vertices of a block's triangles, sheared: x and y so that the ray is the z axis, z along it.
template <int W>
struct ShearedVertices {
  using F = vf<W>;
  vf3<W> a, b, c;

  template <class Block>
  ARBORETUM_INLINE ShearedVertices(const ShearedRay& ray, const Block& block) {
    const F ox(ray.back[0]), oy(ray.back[1]), oz(ray.back[2]), sx(ray.shear[0]), sy(ray.shear[1]);
    const auto shear = [&](const float(&p)[3][W]) {
      const F pz = F::load(ShearedRay::row(p, ray.z)) + oz;
      return vf3<W>{nmadd(sx, pz, F::load(ShearedRay::row(p, ray.x)) + ox), nmadd(sy, pz, F::load(ShearedRay::row(p, ray.y)) + oy), pz};
    };
    a = shear(block.v0), b = shear(block.v1), c = shear(block.v2);
  }
  /// Of one ray a lane: points as seen from their origins.
  ARBORETUM_INLINE ShearedVertices(F sx, F sy, vf3<W> p0, vf3<W> p1, vf3<W> p2) {
    const auto shear = [&](vf3<W> p) { return vf3<W>{nmadd(sx, p.z, p.x), nmadd(sy, p.z, p.y), p.z}; };
    a = shear(p0), b = shear(p1), c = shear(p2);
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
