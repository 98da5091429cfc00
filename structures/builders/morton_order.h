// The order of a mesh's triangles along a Morton curve through their centroids (Lauterbach et al., "Fast BVH
// Construction on GPUs", Eurographics 2009), with codes of 30 or 63 bits.
//
// Only a code's first bits are sorted by; the next ones are looked at where triangles that share those have to be told
// apart. So a sort takes two or three passes, and whoever cuts the order asks for more bits where he is to cut between
// equals. A key of 64 bits holds as much of a code as the triangle's number leaves, of meshes that the caches hold,
// where codes are soon made, 30 bits; what is beyond is computed anew.
#pragma once

#include <cstdint>

#include <emmintrin.h>

#include "core/memory_meter.h"
#include "core/mesh.h"
#include "structures/builders/box4.h"

namespace arboretum {

/// Cells of a cube around (doubled) points: cells as wide on each axis make better boxes than the scene's own
/// proportions.
class MortonCells {
 public:
  MortonCells() = default;
  MortonCells(const Box4& points, unsigned bits);
  /// The code of a point. Points outside count as on the cube's faces, a NaN, as where coordinates overflow, as 0.
  [[nodiscard]] std::uint64_t code(__m128 point) const noexcept;

 private:
  friend class MortonOrder;
  /// Four keys of points and their ids: `count` bits of a code, 60 at most, behind the first `skipped`, both multiples
  /// of 3; below them the id in `id_bits`. Defined beside its users.
  inline void put_keys(const __m128 (&point)[4], __m128i id, unsigned id_bits, unsigned skipped, unsigned count,
                       std::uint64_t* keys) const noexcept;
  [[nodiscard]] static __m128i number(__m128 at, __m128 lower, __m128 scale, __m128 last) noexcept {
    return _mm_cvttps_epi32(_mm_min_ps(_mm_max_ps(_mm_mul_ps(_mm_sub_ps(at, lower), scale), _mm_setzero_ps()), last));
  }
  __m128 lower_, last_, scale_;
  unsigned axis_bits_ = 0;  ///< of a cell's number on an axis
};

/// Triangles sorted by the first bits of their codes, those that share them by id.
class MortonOrder {
 public:
  static constexpr unsigned kAtOnce = 30;  ///< bits of a code that are sorted by at first, at most

  /// `bits` of a code, 30 or 63, of which the first `sorted`, kAtOnce at most, are sorted by. Runs in the caller's TBB
  /// arena. Coordinates are finite.
  MortonOrder(const TriangleMesh& mesh, unsigned bits, unsigned sorted);

  [[nodiscard]] std::size_t size() const noexcept { return keys_.size(); }
  [[nodiscard]] std::uint32_t id(std::size_t i) const noexcept {
    return std::uint32_t(keys_[i] & ((std::uint64_t{1} << id_bits_) - 1));
  }
  /// Bits that refine() may be told of: those sorted by so far, of all ranges to begin with.
  [[nodiscard]] unsigned sorted_bits() const noexcept { return sorted_; }
  /// Whether [begin, end), whose codes are the same as far as they are sorted by, could be told apart by more bits than
  /// the first `sorted`.
  [[nodiscard]] bool refinable(std::size_t begin, std::size_t end, unsigned sorted) const noexcept {
    return sorted < bits_ && agree(begin, end - 1, sorted);
  }
  /// Sorts such a range by the next bits and returns how many it is sorted by then. Its keys may hold other bits from
  /// now on, for cuts inside it.
  unsigned refine(std::size_t begin, std::size_t end, unsigned sorted);
  /// Refines every run of more than `longest` equal codes as far as there are bits. No split() any more.
  void refine_runs(std::size_t longest);

  /// Where [begin, end) of two or more parts: behind the last code that lacks the highest bit in which the first and
  /// the last code differ; in the middle where all are equal.
  [[nodiscard]] std::size_t split(std::size_t begin, std::size_t end) const noexcept;
  /// Where it parts if it is to fill no more blocks of `width` on both sides together than it needs as a whole, two at
  /// least: of these places the one where the highest bit changes, sorted by or not, the first of equals.
  [[nodiscard]] std::size_t split_into_blocks(std::size_t begin, std::size_t end, std::size_t width) const noexcept;

 private:
  [[nodiscard]] std::uint64_t code(std::size_t i) const noexcept { return keys_[i] >> id_bits_; }
  /// How many bits of a key stand below the ones that are sorted by.
  [[nodiscard]] unsigned below(unsigned sorted) const noexcept {
    return id_bits_ + (sorted <= held_ ? held_ : bits_) - sorted;
  }
  [[nodiscard]] bool agree(std::size_t i, std::size_t j, unsigned sorted) const noexcept {
    return (keys_[i] ^ keys_[j]) >> below(sorted) == 0;
  }
  Box4 make_keys();
  void next_codes(std::size_t begin, std::size_t end, std::uint64_t* keys) const noexcept;
  void refine_runs(std::size_t begin, std::size_t end, std::size_t longest, unsigned sorted);

  TriangleBoxes boxes_;
  MortonCells cells_;
  unsigned bits_, sorted_;
  unsigned id_bits_, held_;  ///< of a key: the id's, and how many of a code's it holds at first
  /// The first held_ bits of the code, or in ranges that are sorted by more the others; then the id.
  MeteredVector<std::uint64_t> keys_;
};

}  // namespace arboretum
