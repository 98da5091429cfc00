// What each builder of binary trees is and reads of BuilderParameters; told beside the builder, in the table of
// builders.cpp.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace arboretum {

/// What build_binary_tree reads with that builder; nothing for a builder that is not there.
[[nodiscard]] std::vector<std::string_view> binary_builder_parameters(std::string_view builder);
/// One line for `list`; empty for a builder that is not there.
[[nodiscard]] std::string binary_builder_summary(std::string_view builder);

}  // namespace arboretum
