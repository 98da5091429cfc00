// Making rows of the kernel table from type lists: every combination of leaf block, intersector and box test for which
// a Maker gives kernels.
#pragma once

#include "core/type_list.h"
#include "structures/leaves/blocks.h"
#include "traversal/counting.h"
#include "traversal/kernel_table.h"

namespace arboretum {

/// Where a kernel unit puts its rows.
using KernelRows = std::vector<KernelRow>;

/// An intersector can read a block's form.
template <class Intersector, class Block>
concept CanRead = !Intersector::kNeedsVertices || Block::kForm != TriangleForm::edges;

/// One row for each (block, intersector, box) that can be. `Maker<Block, Intersector, Padded>` has four static
/// functions: closest_hit, any_hit, count_closest_hit, count_any_hit.
template <template <class, class, bool> class Maker, class... Blocks, class... Intersectors>
void add_rows(KernelRows& rows, std::string_view structure, std::string_view traversal, Isa isa, TypeList<Blocks...>, TypeList<Intersectors...>) {
  const auto add = [&]<class Block, class Intersector, bool Padded>(std::type_identity<Block>, std::type_identity<Intersector>, Value<Padded>) {
    if constexpr (CanRead<Intersector, Block>) {
      using M = Maker<Block, Intersector, Padded>;
      rows.push_back({structure, Block::kName, Intersector::kName, Padded ? "padded" : "fast", traversal, isa, &M::closest_hit,
                      &M::any_hit, &M::count_closest_hit, &M::count_any_hit});
    }
  };
  const auto add_block = [&]<class Block>(std::type_identity<Block> block) {
    ((add(block, std::type_identity<Intersectors>{}, Value<false>{}), add(block, std::type_identity<Intersectors>{}, Value<true>{})), ...);
  };
  (add_block(std::type_identity<Blocks>{}), ...);
}

}  // namespace arboretum
