#include "experiments/table_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace arboretum {

std::string format_table(const std::vector<TableRow>& rows, std::size_t figures) {
  std::vector<std::size_t> widths(rows.front().size());
  for (const TableRow& row : rows)
    for (std::size_t i = 0; i < row.size(); ++i) widths[i] = std::max(widths[i], row[i].size());
  std::string text;
  for (const TableRow& row : rows) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      line += i < figures ? fmt::format("{:<{}}  ", row[i], widths[i]) : fmt::format("{:>{}}  ", row[i], widths[i]);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + "\n";
  }
  return text;
}

std::string figure(double value, int decimals) {
  constexpr double kLeastFixed = 1e-6;
  const double size = std::abs(value);
  if (size > 0.0 && size < kLeastFixed) return fmt::format("{:.2e}", value);
  if (size > 0.0 && size < 1.0) decimals = std::max(decimals, 2 - static_cast<int>(std::floor(std::log10(size))));
  return fmt::format("{:.{}f}", value, decimals);
}

std::string counted(std::size_t number, std::string_view noun) {
  return fmt::format("{} {}{}", number, noun, number == 1 ? "" : "s");
}

}  // namespace arboretum
