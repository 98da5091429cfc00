// LeafForm: what a builder has to know of a leaf block at run time, so that its code is compiled once for all blocks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/mesh.h"

namespace arboretum {

struct Box4;

struct LeafForm {
  std::string_view name;  ///< the key: triangle4, ...
  unsigned width;         ///< triangles that a block can hold
  std::size_t bytes;      ///< of a block
  /// Writes blocks for the triangles `ids` of the mesh from `at` on.
  void (*fill)(std::byte* at, const TriangleMesh& mesh, std::span<const std::uint32_t> ids) noexcept;
  /// Appends the triangles of `blocks` consecutive blocks to `out`.
  void (*append)(const std::byte* at, unsigned blocks, std::vector<std::uint32_t>& out);
  /// How many triangles a block holds.
  unsigned (*triangles)(const std::byte* at) noexcept;
  bool indices;  ///< fill() looks at no vertex
  /// fill() that extends a box by those triangles as well.
  void (*fill_and_extend)(std::byte* at, const TriangleMesh& mesh, std::span<const std::uint32_t> ids,
                          Box4& box) noexcept;
};

/// Every form, in the order of AllBlocks.
[[nodiscard]] std::span<const LeafForm> leaf_forms();
/// nullptr where there is none of that name.
[[nodiscard]] const LeafForm* find_leaf_form(std::string_view name);

}  // namespace arboretum
