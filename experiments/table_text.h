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

/// A figure with so many decimals; of one below 1, so that what is small is not 0, three significant digits.
[[nodiscard]] std::string figure(double value, int decimals);

/// Of a long list so many are named on the terminal.
inline constexpr std::size_t kMostNamed = 10;

/// "1 cell", "12 cells".
[[nodiscard]] std::string counted(std::size_t number, std::string_view noun);

}  // namespace arboretum
