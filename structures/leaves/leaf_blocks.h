// LeafBlocks: the arena of a structure whose leaf blocks a builder fills while it makes the tree, when it has the
// triangles in the caches. Nodes go behind them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "core/arena.h"
#include "core/mesh.h"
#include "core/reserved_array.h"
#include "structures/leaves/leaf_form.h"

namespace arboretum {

class LeafBlocks {
 public:
  /// `node_bytes`: what a node takes at most; of a tree there are fewer than leaves.
  LeafBlocks(const LeafForm& form, std::size_t node_bytes) noexcept : form_(form), node_bytes_(node_bytes) {}

  /// Makes so many blocks, and room for nodes.
  void make(std::size_t blocks) {
    bytes_.reserve(blocks * (form_.bytes + node_bytes_));
    bytes_.hand_out(blocks * form_.bytes);
  }
  /// Fills block number `block` and the next ones with triangles of the mesh and extends the box by them.
  void fill(std::size_t block, const TriangleMesh& mesh, std::span<const std::uint32_t> ids, Box4& box) noexcept {
    form_.fill_and_extend(bytes_.data() + block * form_.bytes, mesh, ids, box);
  }
  [[nodiscard]] std::size_t bytes() const noexcept { return bytes_.counted(); }
  /// The blocks, and behind them so many bytes for all nodes.
  [[nodiscard]] Arena take(std::size_t all_nodes) noexcept {
    bytes_.hand_out(all_nodes);
    return Arena(std::move(bytes_));
  }

 private:
  const LeafForm& form_;
  const std::size_t node_bytes_;
  ReservedArray<std::byte> bytes_;
};

}  // namespace arboretum
