// What each combination of intersector and box test promises: the one table that `list`, `list promises`, `verify` and
// docs/numerics.md share. A new intersector or box test has an entry here, and a row in docs/numerics.md; a test holds
// both.
#pragma once

#include <string>
#include <string_view>

namespace arboretum {

/// What of the exact answers is promised, each with what stands above it.
enum class Coverage : unsigned char {
  none,
  edges,   ///< no ray is lost at an edge that two triangles share; at a vertex it may be
  closed,  ///< no ray is lost through a closed surface; past its silhouette it may be, by the rounding of the vertices
  exact    ///< hit or miss, primitive (the lowest id at the nearest t) and t rounded to float are those of exact
           ///< arithmetic
};

/// Of which size t's error is, besides that of its last rounding: what kConditioning is multiplied by. e1, e2: two
/// edges; N: their cross product; |p|: the distance of the farthest corner from the origin; d: the direction.
enum class Conditioning : unsigned char {
  none,      ///< 0
  edges,     ///< |e1||e2| (|p| + t|d|) / |N.d|: edges are subtracted in double
  vertices,  ///< (|e1||e2| + |p| (|e1| + |e2|)) (|p| + t|d|) / |N.d|: corners relative to the origin, then edges
};
/// A component of N is off by at most 4 * 2^-53 of its two products, N.d and N.p by 4 * 2^-53 more, and the products
/// of three unit vectors that such a determinant sums are at most 1.16 in all: 1.16 * 2^-50.
inline constexpr double kConditioning = 0x1p-49;
/// Empty for `none`.
[[nodiscard]] constexpr std::string_view to_string(Conditioning conditioning) noexcept {
  switch (conditioning) {
    case Conditioning::none: return {};
    case Conditioning::edges: return "edges";
    case Conditioning::vertices: return "vertices";
  }
  return {};
}

/// Of intersectors without an `exponent`: the exact t is below 2^kTExponent.
inline constexpr int kTExponent = 127;

/// `coverage` stands on boxes that lose nothing. `t_ulp`: |t - exact t| at most, in units of the last place, where the
/// primitive is right, and what `conditioning` adds to it; 0: no bound. `exponent`: the promise holds where the largest
/// |coordinate| of scene and ray origin and the largest |direction component| are within 2^-exponent .. 2^exponent; 0:
/// for every finite float32, as long as t is below 2^kTExponent.
struct IntersectorPromise {
  std::string_view intersector;
  std::string_view summary;  ///< what `list` says of it
  Coverage coverage;
  double t_ulp;
  Conditioning conditioning;
  int exponent;
  std::string_view remark;
};

inline constexpr IntersectorPromise kIntersectorPromises[] = {
    {"moller_trumbore", "Moeller and Trumbore 1997, on precomputed edges; may miss along edges", Coverage::none, 0,
     Conditioning::none, 40, "the two sides of an edge compute different sums"},
    {"moller_trumbore_double", "moller_trumbore in double: t to half an ulp, may miss along edges", Coverage::none, 0.5,
     Conditioning::edges, 40, "as moller_trumbore, with fewer rays lost and t nearly always to the last bit"},
    {"pluecker", "edge functions relative to the ray's origin, edge times sum of vertices", Coverage::edges, 0,
     Conditioning::none, 40, "the two sides of an edge compute values of exactly opposite sign"},
    {"pluecker_double", "pluecker in double: t to half an ulp, may miss at vertices", Coverage::edges, 0.5,
     Conditioning::vertices, 40, "as pluecker, with t nearly always to the last bit"},
    {"watertight",
     "Woop, Benthin, Wald 2013: with padded boxes no cracks on closed meshes, the same hits in every structure (but of "
     "rays in a triangle's plane)",
     Coverage::closed, 0, Conditioning::none, 40,
     "vertices are rounded once a ray, alike in all triangles; rounding keeps the order"},
    {"watertight_refined", "watertight, and t, u, v of the nearest hit again in double", Coverage::closed, 0.5,
     Conditioning::edges, 40, "as watertight, the nearest hit's t, u, v computed again in double"},
    {"baldwin_weber", "Baldwin and Weber 2016: precomputed map to the unit triangle; may miss along edges",
     Coverage::none, 0, Conditioning::none, 40, "stored transformation: accurate near the origin alone"},
    {"havel_herout", "Havel and Herout 2010: three precomputed planes; may miss along edges", Coverage::none, 0,
     Conditioning::none, 40, "stored planes: accurate near the origin alone"},
    {"wald_projection", "Wald 2004: precomputed projection along an axis; may miss along edges", Coverage::none, 0,
     Conditioning::none, 40, "neighbours are projected along different axes"},
    {"exact",
     "filtered, then exact arithmetic: with padded boxes hit or miss, nearest and t proved right in every structure",
     Coverage::exact, 0.5, Conditioning::none, 0, "filtered, and exact arithmetic where the filter cannot decide"},
};

/// `loses_nothing`: no box that the exact ray touches is missed, and none whose triangle is an ulp nearer than the best
/// hit culled.
struct BoxPromise {
  std::string_view box;
  std::string_view summary;  ///< what `list` says of it
  bool loses_nothing;
  std::string_view remark;
};

inline constexpr BoxPromise kBoxPromises[] = {
    {"fast", "slab test as rounded: may miss a box that the exact ray touches", false,
     "rounding can lose a box that the ray touches at a face, edge or corner"},
    {"ize",
     "Ize 2013: far planes' reciprocals two ulp larger; misses of the boxes that a ray only touches some in a million",
     false,
     "meets boxes that the ray is in for 2^-22 of its distance or more; may miss one that it only touches, or as near "
     "as the best hit"},
    {"padded", "slab test widened by its error bound: never misses a box that the exact ray touches", true,
     "never misses a box that the exact ray touches"},
};

/// The promise of a cell.
struct Promise {
  Coverage coverage = Coverage::none;
  double t_ulp = 0;
  Conditioning conditioning = Conditioning::none;
  int exponent = 0;
  [[nodiscard]] bool any() const noexcept { return coverage != Coverage::none || t_ulp > 0; }
};

/// Combinations that the tables do not name promise nothing; nor does Embree, whose kernels are not ours.
[[nodiscard]] constexpr Promise promise_of(std::string_view structure, std::string_view intersector,
                                           std::string_view box) noexcept {
  if (structure == "embree") return {};
  for (const IntersectorPromise& i : kIntersectorPromises) {
    if (i.intersector != intersector) continue;
    for (const BoxPromise& b : kBoxPromises)
      if (b.box == box) return {b.loses_nothing ? i.coverage : Coverage::none, i.t_ulp, i.conditioning, i.exponent};
  }
  return {};
}

/// `padded` for the tests that promise to lose no hit, `fast` for the others.
[[nodiscard]] constexpr std::string_view box_called_for(std::string_view intersector) noexcept {
  return promise_of("", intersector, "padded").coverage == Coverage::none ? "fast" : "padded";
}

/// With padded boxes its hits are the same, bit for bit, in every structure and way of traversal, but of rays in a
/// triangle's plane (docs/numerics.md).
[[nodiscard]] constexpr bool is_structure_independent(std::string_view intersector) noexcept {
  return promise_of("", intersector, "padded").coverage >= Coverage::closed;
}

/// In words: "crack-free on closed meshes, coordinates within 2^-40 .. 2^40".
[[nodiscard]] inline std::string to_words(const Promise& promise) {
  if (!promise.any()) return "nothing";
  std::string words;
  if (promise.coverage == Coverage::edges) words = "crack-free at shared edges";
  if (promise.coverage == Coverage::closed) words = "crack-free on closed meshes";
  if (promise.coverage == Coverage::exact) words = "exact: hit or miss, nearest primitive, rounded t";
  if (promise.t_ulp > 0 && promise.coverage != Coverage::exact) {
    const int tenths = static_cast<int>(promise.t_ulp * 10 + 0.5);
    words.append(words.empty() ? "t within " : ", t within ").append(std::to_string(tenths / 10)).append(".");
    words.append(std::to_string(tenths % 10)).append(" ulp");
    if (promise.conditioning != Conditioning::none) words.append(" and its conditioning");
  }
  if (promise.exponent == 0)
    return words.append(", every finite float32 with t below 2^").append(std::to_string(kTExponent));
  const std::string exponent = std::to_string(promise.exponent);
  return words.append(", coordinates within 2^-").append(exponent).append(" .. 2^").append(exponent);
}

}  // namespace arboretum
