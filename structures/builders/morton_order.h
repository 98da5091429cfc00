// The order of a mesh's triangles along a Morton curve through their centroids (Lauterbach et al., "Fast BVH Construction on
// GPUs", Eurographics 2009), with codes of 30 or 63 bits.
#pragma once

#include <cstdint>

#include "core/mesh.h"
#include "core/memory_meter.h"

namespace arboretum {

/// Throws UserError unless `bits` is 30 or 63.
void check_morton_bits(unsigned bits);

/// Triangles sorted by code, those of one code by id. Of 63 bits the lower 31 count only where more than a few triangles have the same upper 32:
/// most scenes need no look at them.
class MortonOrder {
 public:
  /// `bits`: 30 or 63. Runs in the caller's TBB arena. Coordinates are finite.
  MortonOrder(const TriangleMesh& mesh, unsigned bits);

  [[nodiscard]] std::size_t size() const noexcept { return keys_.size(); }
  [[nodiscard]] std::uint32_t id(std::size_t i) const noexcept { return std::uint32_t(keys_[i]); }
  /// Where [begin, end) of two or more parts: behind the last code that lacks the highest bit in which the first and the last
  /// code differ; in the middle where all are equal.
  [[nodiscard]] std::size_t split(std::size_t begin, std::size_t end) const noexcept;

 private:
  template <class F>
  void for_runs(const F& f) const;
  template <class Rest>
  void refine(const Rest& rest);
  template <class Code>
  [[nodiscard]] static std::size_t split_at_bit(std::size_t begin, std::size_t end, const Code& code) noexcept;

  /// The code's upper 32 bits (all 30 of the shorter), then the id.
  MeteredVector<std::uint64_t> keys_;
  MeteredVector<std::uint32_t> rest_;  ///< the lower 31 bits by place, 0 in short runs; empty where there are no others
};

}  // namespace arboretum
