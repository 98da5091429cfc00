// kdtree: a binary space partition by axis-aligned planes, leaves in the same blocks as the BVHs' (Havran, "Heuristic
// Ray Shooting Algorithms", 2000; Wald and Havran, "On building fast kd-trees for ray tracing, and on doing that in O(N
// log N)", RT 2006). A triangle that a plane cuts is named on both sides.
//
// Nodes are 8 bytes; siblings are neighbours, and up to four pairs that follow each other stand on a cache line. Nodes
// and leaf blocks lie in one arena, nodes first, and are named in units of 16 bytes, which reaches 16 GiB.
#pragma once

#include <bit>
#include <cstdint>
#include <string>

#include "core/arena.h"
#include "core/type_list.h"
#include "structures/accel.h"

namespace arboretum::kdtree {

/// An inner node: `split` is the plane, the low two bits of `link` its axis, the others where the pair of children is.
/// A leaf: `split` holds the bits of its number of blocks (0: an empty cell), the low bits are 3, the others name its
/// blocks.
struct Node {
  float split;
  std::uint32_t link;

  [[nodiscard]] static Node inner(float plane, int axis, std::size_t offset) noexcept {
    return {plane, std::uint32_t(offset / kUnit) << 2 | std::uint32_t(axis)};
  }
  [[nodiscard]] static Node leaf(std::uint32_t blocks, std::size_t offset) noexcept {
    return {std::bit_cast<float>(blocks), std::uint32_t((blocks ? offset : 0) / kUnit) << 2 | 3u};
  }
  [[nodiscard]] bool is_leaf() const noexcept { return (link & 3) == 3; }
  [[nodiscard]] int axis() const noexcept { return int(link & 3); }
  [[nodiscard]] std::uint32_t blocks() const noexcept { return std::bit_cast<std::uint32_t>(split); }
  /// From the arena's beginning, in bytes.
  [[nodiscard]] std::size_t offset() const noexcept { return std::size_t(link >> 2) * kUnit; }

  static constexpr std::size_t kUnit = 16;
  static constexpr std::size_t kMostBytes = kUnit << 30;
};
static_assert(sizeof(Node) == 8);

/// The bits of a leaf without blocks, whichever.
inline constexpr std::uint64_t kEmptyCell = std::uint64_t{3} << 32;

class KdTree final : public Accel {
 public:
  static constexpr std::string_view kName = "kdtree";
  [[nodiscard]] static const StructureInfo& static_info();
  [[nodiscard]] const StructureInfo& info() const noexcept override { return static_info(); }
  void build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) override;
  [[nodiscard]] bool visit(StructureVisitor& visitor) const override;
  void archive(Archive& archive) override;
  [[nodiscard]] std::size_t bytes() const noexcept override { return arena_.bytes(); }

  [[nodiscard]] const std::byte* base() const noexcept { return arena_.data(); }
  [[nodiscard]] Node root() const noexcept { return root_; }
  /// The root's cell: the scene's bounds, as structures/box_pads.h widens them.
  [[nodiscard]] const Bounds3f& bounds() const noexcept { return bounds_; }
  /// Entries that a traversal stack can need.
  [[nodiscard]] std::size_t stack_entries() const noexcept { return depth_ + 2; }
  /// What padded planes scale their pad with (structures/box_pads.h).
  [[nodiscard]] float max_coordinate() const noexcept { return max_coordinate_; }
  /// The mesh's vertices, which leaf blocks of indices name.
  [[nodiscard]] const Vec3f* vertices() const noexcept { return vertices_; }

 private:
  Arena arena_;
  Node root_{};
  Bounds3f bounds_;
  unsigned depth_ = 0;  ///< of the deepest leaf
  float max_coordinate_ = 0.0f;
  const Vec3f* vertices_ = nullptr;
  std::string leaf_;
};

using Structures = TypeList<KdTree>;

}  // namespace arboretum::kdtree
