// Leaf blocks by name, for structures that take every one of them.
#pragma once

#include <string_view>
#include <vector>

#include "structures/leaves/leaf_form.h"

namespace arboretum {

/// All, in the order of leaf_forms(): StructureInfo::leaves.
[[nodiscard]] std::vector<std::string_view> all_leaf_names();
/// Throws UserError, which names the structure and the nearest leaf, where there is none of that name.
[[nodiscard]] const LeafForm& require_leaf_form(std::string_view structure, std::string_view name);

}  // namespace arboretum
