// Bins of space for spatial splits (Stich, Friedrich, Dietrich, "Spatial Splits in Bounding Volume Hierarchies", HPG
// 2009, section 3.3): a reference goes into every bin that it reaches, with the part of its triangle that lies there.
//
// The parts are estimates in float, for choosing a plane; the references that the split makes are clipped by clip.h.
// Unlike the paper, the part of a triangle in a slab is taken from the points where its edges pass the slab's planes,
// all bins at once, not by chopping the rest plane by plane.
#pragma once

#include "structures/builders/sah_references.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {
namespace sah {

inline constexpr unsigned kMaxSpatialBins = 16;

struct SpatialBins {
  Box box[3][kMaxSpatialBins];
  /// references by their first and last bin, then axis
  std::int32_t enter4[kMaxSpatialBins][4], leave4[kMaxSpatialBins][4];
  float saved4[kMaxSpatialBins][4];  ///< half area that references lose when they are split by the plane before a bin
};

/// Maps coordinates within the box of a range to bins, and bins to the planes before them.
struct SpatialMap {
  vf<4> lower, scale, width;
  unsigned bins;

  SpatialMap(Box bounds, std::size_t n) {
    bins = n < 256 ? 8u : kMaxSpatialBins;
    const vf<4> extent = high_half(bounds) + low_half(bounds);
    lower = -low_half(bounds), width = extent * vf<4>(1.0f / float(bins));
    scale = select(extent > vf<4>(kFlat), vf<4>(float(bins)) / extent, vf<4>(0.0f));
  }
  /// The bins of three coordinates.
  ARBORETUM_INLINE vi<4> operator()(vf<4> position) const {
    const vf<4> bin = three_lanes(position - lower) * scale;
    return truncate_to_int(min_x86(max_x86(bin, vf<4>(0.0f)), vf<4>(float(bins - 1))));
  }
  ARBORETUM_INLINE void reach(const Reference& r, std::int32_t* first, std::int32_t* last) const {
    (*this)(-vf<4>::load(r.neg_lower)).store(first), (*this)(vf<4>::load(r.upper)).store(last);
  }
};

/// One axis of a SpatialMap, with the same results.
struct SpatialAxis {
  float lower, scale, width;
  std::int32_t bins;
  int axis;
  SpatialAxis(const SpatialMap& map, int a)
      : lower(lane_of(map.lower, a)), scale(lane_of(map.scale, a)), width(lane_of(map.width, a)),
        bins(std::int32_t(map.bins)), axis(a) {}
  ARBORETUM_INLINE std::int32_t operator()(float position) const {
    return std::min(std::max(std::int32_t((position - lower) * scale), 0), bins - 1);
  }
  ARBORETUM_INLINE float plane(std::int32_t bin) const { return lower + width * float(bin); }
};

inline void clear(SpatialBins& bins, unsigned n) {
  for (auto& axis : bins.box) {
    for (unsigned b = 0; b < n; ++b) axis[b] = empty_box();
  }
  std::memset(bins.enter4, 0, n * sizeof bins.enter4[0]);
  std::memset(bins.leave4, 0, n * sizeof bins.leave4[0]);
  std::memset(bins.saved4, 0, n * sizeof bins.saved4[0]);
}

inline void merge(SpatialBins& into, const SpatialBins& from, unsigned n) {
  for (int axis = 0; axis < 3; ++axis) {
    for (unsigned b = 0; b < n; ++b) {
      into.box[axis][b] = max_x86(into.box[axis][b], from.box[axis][b]);
      into.enter4[b][axis] += from.enter4[b][axis], into.leave4[b][axis] += from.leave4[b][axis];
      into.saved4[b][axis] += from.saved4[b][axis];
    }
  }
}

/// Half the area of a box, 0 of an empty one.
ARBORETUM_INLINE float half_area_or_0(Box box) {
  const vf<4> d = max_x86(high_half(box) + low_half(box), vf<4>(0.0f));
  alignas(16) float e[4];
  d.store(e);
  return e[0] * (e[1] + e[2]) + e[1] * e[2];
}

/// Spreads a reference over bins [first, last], first < last, of an axis.
inline void spread(const Reference& r, const vf<4> (&corner)[3], const SpatialAxis& map, std::int32_t first,
                   std::int32_t last, SpatialBins& bins) {
  Box part[kMaxSpatialBins];
  for (std::int32_t b = first; b <= last; ++b) part[b] = empty_box();
  const float begin = -r.neg_lower[map.axis], end = r.upper[map.axis];
  float x[3];
  for (int i = 0; i < 3; ++i) {
    x[i] = lane_of(corner[i], map.axis);
    if (x[i] < begin || x[i] > end) continue;
    const std::int32_t b = std::min(std::max(map(x[i]), first), last);
    part[b] = max_x86(both_halves(-corner[i], corner[i]), part[b]);
  }
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, low = x[i] < x[j] ? i : j, high = x[i] < x[j] ? j : i;
    if (!(x[low] < x[high])) continue;
    const vf<4> from = corner[low], step = (corner[high] - from) * vf<4>(1.0f / (x[high] - x[low]));
    // The planes before the bins, and the reference's own two ends, where it may have been clipped.
    for (std::int32_t k = first; k <= last + 1; ++k) {
      const float plane = k == first ? begin : k > last ? end : map.plane(k);
      if (!(plane > x[low] && plane < x[high])) continue;
      const vf<4> p = from + step * vf<4>(plane - x[low]);
      const Box point = both_halves(-p, p);
      if (k > first) part[k - 1] = max_x86(point, part[k - 1]);
      if (k <= last) part[k] = max_x86(point, part[k]);
    }
  }
  const Box whole = Box::load(&r);
  for (std::int32_t b = first; b <= last; ++b) {
    part[b] = min_x86(part[b], whole);
    bins.box[map.axis][b] = max_x86(part[b], bins.box[map.axis][b]);
  }
  float right_area[kMaxSpatialBins];
  Box side = empty_box();
  for (std::int32_t b = last; b > first; --b) side = max_x86(part[b], side), right_area[b] = half_area_or_0(side);
  side = empty_box();
  const float area = half_area_or_0(whole);
  for (std::int32_t b = first + 1; b <= last; ++b) {
    side = max_x86(part[b - 1], side);
    bins.saved4[b][map.axis] += area - half_area_or_0(side) - right_area[b];
  }
}

inline void bin(const TriangleMesh& mesh, const Reference* r, const Reference* end, const SpatialMap& map,
                SpatialBins& bins) {
  clear(bins, map.bins);
  const SpatialAxis axes[3] = {{map, 0}, {map, 1}, {map, 2}};
  for (; r < end; ++r) {
    alignas(16) std::int32_t first[4], last[4];
    map.reach(*r, first, last);
    const Box box = Box::load(r);
    vf<4> corner[3];
    bool have_corners = false;
    for (int axis = 0; axis < 3; ++axis) {
      ++bins.enter4[first[axis]][axis], ++bins.leave4[last[axis]][axis];
      if (first[axis] == last[axis]) {
        bins.box[axis][first[axis]] = max_x86(box, bins.box[axis][first[axis]]);
        continue;
      }
      if (!have_corners) {
        const Triangle t = mesh.triangles[r->id];
        corner[0] = vertex(mesh, t.a), corner[1] = vertex(mesh, t.b), corner[2] = vertex(mesh, t.c);
        have_corners = true;
      }
      spread(*r, corner, axes[axis], first[axis], last[axis], bins);
    }
  }
}

/// Bins of references [r, end); many are binned in parallel.
inline void bin_range(const TriangleMesh& mesh, const Reference* r, const Reference* end, const SpatialMap& map,
                      SpatialBins& total) {
  const std::size_t n = std::size_t(end - r);
  if (n <= kLarge) return bin(mesh, r, end, map, total);
  MeteredVector<SpatialBins> chunks((n + kChunk - 1) / kChunk);
  tbb::parallel_for(std::size_t{0}, chunks.size(), [&](std::size_t c) {
    bin(mesh, r + c * kChunk, std::min(end, r + (c + 1) * kChunk), map, chunks[c]);
  });
  clear(total, map.bins);
  for (const SpatialBins& b : chunks) merge(total, b, map.bins);
}

struct SpatialSplit {
  float cost = std::numeric_limits<float>::infinity();
  int axis = -1;
  std::int32_t bin = 0;
  std::size_t left_count = 0, right_count = 0;
  float saved = 0.0f;  ///< half area that the references lose
  Box left, right;
};

/// The cheapest plane among those that leave fewer than `total` references on either side and at most `room` on both.
inline SpatialSplit best_split(const SpatialBins& bins, unsigned n, std::size_t total, std::size_t room,
                               unsigned leaf_width) {
  const BlocksFor blocks(leaf_width);
  const vf<4> zero(0.0f), none(std::numeric_limits<float>::infinity());
  vf<4> right_cost[kMaxSpatialBins], right_count[kMaxSpatialBins];
  const vf<4> whole = to_float(vi<4>(std::int32_t(total))), most = to_float(vi<4>(std::int32_t(room)));
  const auto fits = [&](vf<4> count) { return (count > zero) & (count < whole); };
  Box box[3] = {empty_box(), empty_box(), empty_box()};
  vf<4> count(0.0f);
  for (unsigned b = n; --b > 0;) {
    for (int axis = 0; axis < 3; ++axis) box[axis] = max_x86(bins.box[axis][b], box[axis]);
    count = count + to_float(vi<4>::load(bins.leave4[b]));
    right_count[b] = count;
    right_cost[b] = select(fits(count), half_areas(box) * blocks(count), none);
  }
  for (Box& side : box) side = empty_box();
  count = vf<4>(0.0f);
  CheapestPlanes planes;
  for (unsigned b = 1; b < n; ++b) {
    for (int axis = 0; axis < 3; ++axis) box[axis] = max_x86(bins.box[axis][b - 1], box[axis]);
    count = count + to_float(vi<4>::load(bins.enter4[b - 1]));
    const vf<4> cost =
        select(fits(count) & (count + right_count[b] <= most), half_areas(box) * blocks(count) + right_cost[b], none);
    planes.offer(cost, b);
  }
  SpatialSplit best;
  best.left = best.right = empty_box();
  planes.pick(best);
  if (best.axis < 0) return best;
  best.saved = bins.saved4[best.bin][best.axis];
  for (std::int32_t b = 0; b < std::int32_t(n); ++b) {
    if (b < best.bin) {
      best.left_count += std::uint32_t(bins.enter4[b][best.axis]),
          best.left = max_x86(bins.box[best.axis][b], best.left);
    } else {
      best.right_count += std::uint32_t(bins.leave4[b][best.axis]),
          best.right = max_x86(bins.box[best.axis][b], best.right);
    }
  }
  // Float counts err above 2^24
  if (best.left_count + best.right_count > room || best.left_count >= total || best.right_count >= total)
    best.axis = -1;
  return best;
}

}  // namespace sah
}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
