#include "structures/parameters_read.h"

#include <algorithm>

#include "structures/registry.h"

namespace arboretum {

std::optional<std::vector<std::string_view>> parameters_read(std::string_view structure, std::string_view builder,
                                                             std::string_view below) {
  // Of registered_structures(), which all_structures() begins with.
  static const std::vector<BuilderParametersOf> declared = registered_parameters();
  const std::span<const StructureEntry> all = all_structures();
  const auto entry = std::ranges::find(all, structure, [](const StructureEntry& e) { return e.info.name; });
  if (entry == all.end() || !entry->info.uses_parameters) return std::vector<std::string_view>{};
  const auto index = std::size_t(entry - all.begin());
  if (index >= declared.size() || !declared[index]) return std::nullopt;
  std::vector<std::string_view> names = declared[index](builder);
  if (entry->info.takes_below && !below.empty() && below != structure) {
    const auto more = parameters_read(below, builder);
    if (!more) return std::nullopt;
    names.insert(names.end(), more->begin(), more->end());
  }
  std::ranges::sort(names);
  names.erase(std::unique(names.begin(), names.end()), names.end());  // clang 14 has no std::ranges::unique
  return names;
}

}  // namespace arboretum
