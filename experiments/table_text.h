// Tables of plain text.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace arboretum {

using TableRow = std::vector<std::string>;

/// Columns as wide as their widest cell; figures right-aligned from column `figures` on. All rows as long as the first,
/// its titles.
[[nodiscard]] std::string format_table(const std::vector<TableRow>& rows, std::size_t figures);

/// "1 cell", "12 cells".
[[nodiscard]] std::string counted(std::size_t number, std::string_view noun);

}  // namespace arboretum
