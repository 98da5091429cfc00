#include "structures/leaves/leaf_form.h"

#include <string>

#include "core/error.h"
#include "core/names.h"
#include "structures/leaves/fill_leaves.h"
#include "structures/leaves/leaf_names.h"

namespace arboretum {

std::span<const LeafForm> leaf_forms() {
  static const std::vector<LeafForm> forms = [] {
    std::vector<LeafForm> list;
    for_each_type(AllBlocks{}, [&]<class Block>(std::type_identity<Block>) {
      list.push_back(
          {Block::kName, unsigned(Block::kWidth), sizeof(Block),
           [](std::byte* at, const TriangleMesh& mesh, std::span<const std::uint32_t> ids) noexcept {
             fill_leaf(reinterpret_cast<Block*>(at), mesh, ids, [](__m128, __m128, __m128) {});
           },
           [](const std::byte* at, unsigned blocks, std::vector<std::uint32_t>& out) {
             append_primitives(reinterpret_cast<const Block*>(at), blocks, out);
           },
           [](const std::byte* at) noexcept { return unsigned(triangles_in(*reinterpret_cast<const Block*>(at))); },
           Block::kForm == TriangleForm::indices,
           [](std::byte* at, const TriangleMesh& mesh, std::span<const std::uint32_t> ids, Box4& box) noexcept {
             Box4 all = box;
             fill_leaf(reinterpret_cast<Block*>(at), mesh, ids,
                       [&all](__m128 a, __m128 b, __m128 c) { all.extend(a), all.extend(b), all.extend(c); });
             box = all;
           }});
    });
    return list;
  }();
  return forms;
}

std::vector<std::string_view> all_leaf_names() {
  std::vector<std::string_view> names;
  for (const LeafForm& form : leaf_forms()) names.push_back(form.name);
  return names;
}

const LeafForm* find_leaf_form(std::string_view name) {
  for (const LeafForm& form : leaf_forms())
    if (form.name == name) return &form;
  return nullptr;
}

const LeafForm& require_leaf_form(std::string_view structure, std::string_view name) {
  if (const LeafForm* form = find_leaf_form(name)) return *form;
  const std::vector<std::string_view> all = all_leaf_names();
  throw UserError(unknown_name_message("leaf of " + std::string(structure), std::string(name),
                                       std::vector<std::string>(all.begin(), all.end())));
}

}  // namespace arboretum
