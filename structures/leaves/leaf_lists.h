// From lists of triangles to leaf blocks, for structures whose leaves share triangles (grid, octree): leaves
// that hold the same triangles share their blocks, so a wall that runs through a thousand empty cells costs
// one block.
//
// A leaf is named by 32 bits: the first block's number above, four bits below with the number of blocks, 1 ..
// 13; kLongLeaf there makes it the number of a LongLeaf instead; 0 is a leaf without triangles. kNoLeaf is
// left to the structure.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/arena.h"
#include "core/memory_meter.h"
#include "core/mesh.h"
#include "intersectors/blocks.h"

namespace arboretum {

class Archive;

using LeafCode = std::uint32_t;
inline constexpr LeafCode kEmptyLeaf = 0, kLongLeaf = 14, kNoLeaf = 15, kLeafCountMask = 15;
inline constexpr unsigned kLeafShift = 4;

struct LongLeaf {
  std::uint32_t first, blocks;
};

/// List i is ids[begin[i], begin[i + 1]), in rising order.
struct LeafLists {
  MeteredVector<std::uint32_t> begin;
  MeteredVector<std::uint32_t> ids;
  [[nodiscard]] std::span<const std::uint32_t> operator[](std::size_t i) const noexcept {
    return {ids.data() + begin[i], begin[i + 1] - begin[i]};
  }
  [[nodiscard]] std::size_t size() const noexcept { return begin.empty() ? 0 : begin.size() - 1; }
};

/// The leaf blocks of a structure and what traversal needs to read them.
class LeafStore {
 public:
  /// Writes the blocks of all lists and codes[i] for list i; empty lists leave codes[i] as it is. Parallel,
  /// the same for any number of threads. Throws UserError when there would be 2^28 blocks; `structure` is its
  /// name in the message. Without `share` equal lists get blocks of their own: for structures in which there
  /// are none.
  void fill(const TriangleMesh& mesh, const LeafLists& lists, std::string_view leaf, std::string_view structure,
            bool share, LeafCode* codes);

  /// Saves or loads (structures/archive.h).
  void archive(Archive& archive);

  [[nodiscard]] const std::byte* blocks() const noexcept { return blocks_.data(); }
  [[nodiscard]] const LongLeaf* long_leaves() const noexcept { return long_leaves_.data(); }
  [[nodiscard]] const std::string& leaf() const noexcept { return leaf_; }
  /// The mesh's vertices, which leaf blocks of indices name.
  [[nodiscard]] const Vec3f* vertices() const noexcept { return vertices_; }
  [[nodiscard]] std::size_t bytes() const noexcept { return blocks_.bytes() + long_leaves_.size() * sizeof(LongLeaf); }
  /// The blocks of a code that is neither empty nor kNoLeaf.
  [[nodiscard]] LongLeaf range(LeafCode code) const noexcept {
    const LeafCode count = code & kLeafCountMask;
    return count == kLongLeaf ? long_leaves_[code >> kLeafShift] : LongLeaf{code >> kLeafShift, count};
  }

 private:
  Arena blocks_;
  MeteredVector<LongLeaf> long_leaves_;
  const Vec3f* vertices_ = nullptr;
  std::string leaf_;
};

}  // namespace arboretum
