// What `watertight` and `exact` keep for a packet beside its rays: their shears, and in which order each has its axes.
#pragma once

#include "intersectors/sheared_ray.h"
#include "intersectors/triangle_hits.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Rays of a group have the same axis along which their direction is largest.
struct ShearedPacket {
  static constexpr int kGroups = 3;
  alignas(64) float sx[PacketRays::kMost], sy[PacketRays::kMost], sz[PacketRays::kMost];
  std::uint64_t of_axis[3];

  void clear() { of_axis[0] = of_axis[1] = of_axis[2] = 0; }
  /// The W rays from k on: what ShearedRay computes for one, bit for bit.
  template <int W>
  ARBORETUM_INLINE void prepare(const PacketRays& rays, int k) {
    using F = vf<W>;
    const F x = F::load(rays.direction[0] + k), y = F::load(rays.direction[1] + k), z = F::load(rays.direction[2] + k);
    const F ax = abs(x), ay = abs(y), az = abs(z);
    const vm<W> by_x = (ax > ay) & (ax > az), by_y = ~(ax > ay) & (ay > az);
    const F dz = select(by_x, x, select(by_y, y, z));
    (select(by_x, y, select(by_y, z, x)) / dz).store(sx + k);
    (select(by_x, z, select(by_y, x, y)) / dz).store(sy + k);
    (F(-1.0f) / dz).store(sz + k);
    of_axis[0] |= std::uint64_t(by_x.bits()) << k, of_axis[1] |= std::uint64_t(by_y.bits()) << k,
        of_axis[2] |= std::uint64_t((~(by_x | by_y)).bits()) << k;
  }
  [[nodiscard]] std::uint64_t group(int kz) const { return of_axis[kz]; }
  /// That along which ray i's direction is largest.
  [[nodiscard]] ARBORETUM_INLINE unsigned axis(int i) const {
    return of_axis[0] >> i & 1u ? 0 : of_axis[1] >> i & 1u ? 1 : 2;
  }
  /// Triangle i of the block as the W rays from k on see it, which are of group kz.
  template <int W, class Block>
  [[nodiscard]] ARBORETUM_INLINE ShearedVertices<W> sheared(const PacketRays& rays, int kz, int k, const Block& block,
                                                            int i) const {
    using F = vf<W>;
    const int kx = kz == 2 ? 0 : kz + 1, ky = kx == 2 ? 0 : kx + 1;
    const vf3<W> o{F::load(rays.origin[kx] + k), F::load(rays.origin[ky] + k), F::load(rays.origin[kz] + k)};
    const auto seen = [&](const float(&p)[3][Block::kWidth]) {
      return o - vf3<W>{F(p[kx][i]), F(p[ky][i]), F(p[kz][i])};
    };
    return {F::load(sx + k), F::load(sy + k), seen(block.v0), seen(block.v1), seen(block.v2)};
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
