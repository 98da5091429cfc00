#include "structures/builders/embree_splits.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "structures/builders/clip.h"

namespace arboretum {
namespace {

/// What rounding moves a bin's number and a plane by is less than this share of the largest |coordinate| of a set:
/// 2^-21 of the set's extent, which is at most twice as large, and half an ulp. Of a set we know but the whole mesh's.
constexpr float kThin = 0x1p-19f;
/// A part no thicker than this share of the coordinates at the plane, 4 to 8 ulps, may have its centre in a bin beyond
/// it. Embree's bins are twice as wide and more: no reference that begins with its set, or ends with it, is one of
/// them.
constexpr float kLost = 0x1p-21f;
constexpr std::size_t kWordsPerTriangle = 2;  ///< some tens of cuts of a triangle are counted, few of them thin
constexpr std::size_t kLeastWords = 1024;

/// The part of the box that is nearest to `part`: where they do not meet, flat.
Bounds3f nearest(const Bounds3f& part, const Bounds3f& box) noexcept {
  return {min(max(part.lower, box.lower), box.upper), max(min(part.upper, box.upper), box.lower)};
}

}  // namespace

EmbreeSplits::EmbreeSplits(const TriangleMesh& mesh)
    : mesh_(mesh), counted_(std::bit_ceil(std::max(kLeastWords, kWordsPerTriangle * mesh.size()))) {
  Vec3f largest{0, 0, 0};
  for (const Vec3f& p : mesh.vertices) largest = max(largest, {std::fabs(p.x), std::fabs(p.y), std::fabs(p.z)});
  thin_ = largest * kThin;
}

std::uint64_t EmbreeSplits::bit_of(std::uint32_t id, const Bounds3f& box, int axis, float plane) const noexcept {
  std::uint64_t x = (std::uint64_t{std::bit_cast<std::uint32_t>(plane)} << 32) | id;
  for (const std::uint32_t next : {std::bit_cast<std::uint32_t>(box.upper[axis]), std::uint32_t(axis)}) {
    x = (x ^ (x >> 32)) * 0x9e3779b97f4a7c15;
    x = (x ^ (x >> 29) ^ next) * 0xbf58476d1ce4e5b9;
  }
  return (x ^ (x >> 32)) & (64 * counted_.size() - 1);
}

bool EmbreeSplits::is_counted(std::uint64_t bit, bool counts) noexcept {
  std::atomic<std::uint64_t>& word = counted_[bit / 64];
  const std::uint64_t mask = std::uint64_t{1} << (bit % 64);
  if (counts) word.fetch_or(mask, std::memory_order_relaxed);
  return (word.load(std::memory_order_relaxed) & mask) != 0;
}

void EmbreeSplits::split(std::uint32_t id, const Bounds3f& box, int axis, float plane, bool counts, Bounds3f& low,
                         Bounds3f& high) {
  low = high = {};
  if (!(box.lower[axis] < plane && plane < box.upper[axis])) {
    (plane <= box.lower[axis] ? high : low) = box;
    return;
  }
  // Of the box only the upper end is the same while parts are counted, where it begins at the plane before.
  const float below = plane - box.lower[axis], above = box.upper[axis] - plane, thinner = std::min(below, above);
  const bool whole = thinner <= kLost * std::max(std::fabs(plane), std::fabs(box.upper[axis])) ||
                     (thinner <= thin_[axis] && !is_counted(bit_of(id, box, axis, plane), counts));
  if (whole) {
    (0.5f * (box.lower[axis] + box.upper[axis]) < plane ? low : high) = box;  // as Embree sorts it
    return;
  }
  clip_by_plane(mesh_.corners(id), axis, plane, low, high);
  low = nearest(low, box), high = nearest(high, box);
  low.lower[axis] = box.lower[axis], high.upper[axis] = box.upper[axis];
  low.upper[axis] = high.lower[axis] = plane;
}

}  // namespace arboretum
