// Up to 64 rays side by side: what packets and streams keep of their rays, whatever the structure.
#pragma once

#include "intersectors/triangle_hits.h"
#include "simd/swizzle.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Structures of arrays.
struct LaneRays {
  static constexpr int kMost = PacketRays::kMost;
  PacketRays rays;
  alignas(64) float t[kMost];  ///< beyond which nothing counts: tfar, and what has been met
  std::uint64_t valid;         ///< valid rays (core/ray.h)
  std::uint64_t negative[3];   ///< by axis: the direction is negative, or -0

 protected:
  /// Of `count` rays, 1 to kMost, of which `ray_at(i)` is the i-th; lanes up to the next multiple of W hold no ray.
  /// `each(k)` is called for k = 0, W, 2 W ... when the W rays from k on stand in `rays`.
  template <int W, class RayAt, class Each>
  ARBORETUM_INLINE void prepare(int count, const RayAt& ray_at, const Each& each) {
    place(count, ray_at);
    valid = negative[0] = negative[1] = negative[2] = 0;
    for (int k = 0; k < count; k += W) {
      valid |= std::uint64_t(are_rays<W>(k).bits()) << k;
      for (int a = 0; a < 3; ++a)
        negative[a] |= std::uint64_t((sign_bits(vf<W>::load(rays.direction[a] + k)) < vi<W>(0)).bits()) << k;
      each(k);
    }
    valid &= count == kMost ? ~std::uint64_t{0} : (std::uint64_t{1} << count) - 1;
  }

 private:
  /// Of rays k to k + `last`, the last one again where that is fewer than four.
  template <class RayAt>
  ARBORETUM_INLINE void place_four(int k, int last, const RayAt& ray_at) {
    vf<4> low[4], high[4];
    for (int j = 0; j < 4; ++j) {
      const Ray& ray = ray_at(k + (j < last ? j : last));
      low[j] = vf<4>::load(&ray.origin), high[j] = vf<4>::load(&ray.direction);
    }
    transpose(low), transpose(high);
    for (int a = 0; a < 3; ++a) low[a].store(rays.origin[a] + k), high[a].store(rays.direction[a] + k);
    low[3].store(rays.tnear + k), high[3].store(t + k);
  }
  template <class RayAt>
  ARBORETUM_INLINE void place(int count, const RayAt& ray_at) {
    int k = 0;
    for (; k + 4 <= count; k += 4) place_four(k, 3, ray_at);
    if (k < count) place_four(k, count - 1 - k, ray_at);
    // A register may be wider than four rays.
    for (int i = (count + 3) & ~3; i < kMost && (i & 15) != 0; ++i) {
      for (int a = 0; a < 3; ++a) rays.origin[a][i] = rays.direction[a][i] = 0.0f;
      rays.tnear[i] = t[i] = 0.0f;
    }
  }

  template <int W>
  ARBORETUM_INLINE vm<W> are_rays(int k) const {
    using F = vf<W>;
    const F infinity(std::numeric_limits<float>::infinity());
    vm<W> finite = F::load(rays.tnear + k) <= F::load(t + k), moves(false);
    for (int a = 0; a < 3; ++a) {
      const F d = F::load(rays.direction[a] + k);
      finite = finite & (abs(F::load(rays.origin[a] + k)) < infinity) & (abs(d) < infinity),
      moves = moves | (d != F(0.0f));
    }
    return finite & moves;
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
