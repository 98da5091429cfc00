// Writing a built tree into the arena: nodes, then leaf blocks.
#pragma once

#include <functional>

#include "core/arena.h"
#include "structures/kdtree/kdtree.h"
#include "structures/kdtree/top_down.h"

namespace arboretum::kdtree {

/// Where a leaf's blocks go, and what is in them.
struct LeafPlan {
  std::size_t offset;
  const std::uint32_t* ids;
  std::uint32_t count;
};

/// A tree's nodes in the arena, and what is to be filled in.
struct Layout {
  Arena arena;
  Node root{};
  unsigned depth = 0;  ///< of the deepest leaf
  MeteredVector<LeafPlan> leaves;
};

/// Lays the tree out for blocks of `width` triangles and `block_bytes`: all nodes in their places, leaf blocks still to
/// be filled. Throws UserError where 32-bit links cannot reach.
[[nodiscard]] Layout lay_out(const Part& tree, unsigned width, std::size_t block_bytes);

}  // namespace arboretum::kdtree
