#include "structures/leaves/leaf_form.h"

#include "structures/leaves/fill_leaves.h"

namespace arboretum {

std::span<const LeafForm> leaf_forms() {
  static const std::vector<LeafForm> forms = [] {
    std::vector<LeafForm> list;
    for_each_type(AllBlocks{}, [&]<class Block>(std::type_identity<Block>) {
      list.push_back(
          {Block::kName, unsigned(Block::kWidth), sizeof(Block),
           [](std::byte* at, const TriangleMesh& mesh, std::span<const std::uint32_t> ids) noexcept {
             fill_leaf(reinterpret_cast<Block*>(at), mesh, ids);
           },
           [](const std::byte* at, unsigned blocks, std::vector<std::uint32_t>& out) {
             append_primitives(reinterpret_cast<const Block*>(at), blocks, out);
           },
           [](const std::byte* at) noexcept { return unsigned(triangles_in(*reinterpret_cast<const Block*>(at))); }});
    });
    return list;
  }();
  return forms;
}

const LeafForm* find_leaf_form(std::string_view name) {
  for (const LeafForm& form : leaf_forms())
    if (form.name == name) return &form;
  return nullptr;
}

}  // namespace arboretum
