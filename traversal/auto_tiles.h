// What `auto` looks at: a batch's rays, tile by tile of 64.
//
// A tile is coherent when a sample of its rays leaves no wide cone: their directions lie close together. Where its rays
// are not, they may start near each other: within `Family::kNear` of the extent of all origins of the batch.
#pragma once

#include <algorithm>
#include <limits>

#include "traversal/leaves.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <class Family>
struct AutoTiles {
  static constexpr std::size_t kTile = 64;
  /// Of the directions' own length, the half extent of those that still count as coherent. Rays towards a light fan out
  /// the more the nearer it is, and share their end all the same.
  static constexpr float kCone = 0.25f, kAnyHitCone = 0.5f;
  /// So many tiles one after the other make a change: streams and packets both begin and end slowly.
  static constexpr unsigned kSwitch = 4;
  /// Smaller batches are too few to share anything.
  static constexpr std::size_t kFew = 8;
  /// Where a ray that would be looked at is not valid (core/ray.h), so many are, from it on: the first valid one
  /// counts.
  static constexpr std::size_t kLook = 8;
  /// Of `count` rays' directions or origins, of which some `samples` are looked at, valid ones alone: the largest
  /// extent along an axis, negative where there is none, and the largest |coordinate|.
  struct Spread {
    float extent, largest;
  };
  [[nodiscard]] static Spread spread(const Ray* rays, std::size_t count, std::size_t samples, Vec3f Ray::*part) {
    vf<4> low(std::numeric_limits<float>::infinity()), high(-std::numeric_limits<float>::infinity());
    const std::size_t step = std::max(count / samples, std::size_t{1});
    for (std::size_t i = 0; i < count; i += step) {
      const std::size_t end = std::min(i + std::min(step, kLook), count);
      std::size_t at = i;
      while (at < end && !is_valid_in_lanes(rays[at])) ++at;
      if (at == end) continue;
      const vf<4> v = vf<4>::load(&(rays[at].*part));
      low = min_x86(low, v), high = max_x86(high, v);
    }
    alignas(16) float extent[4], size[4];
    (high - low).store(extent), max_x86(abs(low), abs(high)).store(size);
    return {std::max({extent[0], extent[1], extent[2]}), std::max({size[0], size[1], size[2]})};
  }

  /// `any`: no ray of its sample is valid.
  enum class Kind { coherent, near, apart, any };
  [[nodiscard]] static Kind kind_of(const Ray* rays, std::size_t count, float cone, float near) {
    if (count < kFew) return Kind::apart;
    const Spread directions = spread(rays, count, 8, &Ray::direction);
    if (directions.extent < 0.0f) return Kind::any;
    if (directions.extent <= 2.0f * cone * directions.largest) return Kind::coherent;
    return Family::kNear > 0.0f && spread(rays, count, 8, &Ray::origin).extent <= near ? Kind::near : Kind::apart;
  }

  /// Calls run(end, kind) for runs of tiles of one kind, in their order: each begins where the last one ended.
  template <class Run>
  static void for_each_run(const RayBatch& rays, float cone, const Run& run) {
    const float near =
        Family::kNear > 0.0f ? Family::kNear * spread(&rays[0], rays.size(), 64, &Ray::origin).extent : 0.0f;
    Kind kind = Kind::any, next = Kind::any;
    std::size_t others = 0, change = 0;  // tiles of the kind `next`, one after the other, and where they begin
    std::size_t alike = 0, last = 0;     // tiles of `kind`, one after the other, and the last of them
    for (std::size_t at = 0; at < rays.size(); at += kTile) {
      const Kind now = kind_of(&rays[at], std::min(kTile, rays.size() - at), cone, near);
      if (now == Kind::any) continue;  // goes as the tiles beside it do
      if (kind == Kind::any) kind = now;
      if (now == kind) {
        others = 0, last = at;
        // Then one tile in kSwitch is looked at: a change of so many tiles is seen all the same.
        if (++alike >= kSwitch) at += (kSwitch - 1) * kTile;
        continue;
      }
      if (others == 0 && alike >= kSwitch) {  // those that were passed over
        at = last, alike = 0;
        continue;
      }
      alike = 0;
      if (others == 0 || now != next) others = 0, change = at, next = now;
      if (++others < kSwitch) continue;
      run(change, kind);
      kind = now, others = 0;
    }
    run(rays.size(), kind);
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
