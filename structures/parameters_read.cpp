#include "structures/parameters_read.h"

#include <algorithm>

#include "structures/builders/builder_parameters.h"
#include "structures/registry.h"

namespace arboretum {

const StructureBuilders* builders_of_structure(std::string_view structure) {
  static const std::vector<StructureBuilders> declared = registered_builders();  // in the order of all_structures()
  const StructureEntry* entry = find_structure(structure);
  return entry ? &declared[std::size_t(entry - all_structures().data())] : nullptr;
}

std::optional<std::vector<std::string_view>> parameters_read(std::string_view structure, std::string_view builder,
                                                             std::string_view below) {
  const StructureEntry* entry = find_structure(structure);
  if (!entry || !entry->info.uses_parameters) return std::vector<std::string_view>{};
  const StructureBuilders* builders = builders_of_structure(structure);
  if (!builders->reads) return std::nullopt;
  std::vector<std::string_view> names = builders->reads(builder);
  if (entry->info.takes_below && !below.empty() && below != structure) {
    const auto more = parameters_read(below, builder);
    if (!more) return std::nullopt;
    names.insert(names.end(), more->begin(), more->end());
  }
  std::ranges::sort(names);
  names.erase(std::unique(names.begin(), names.end()), names.end());  // clang 14 has no std::ranges::unique
  return names;
}

std::string builder_summary(std::string_view structure, std::string_view builder) {
  const StructureBuilders* builders = builders_of_structure(structure);
  const std::string_view own = builders && builders->summary ? builders->summary(builder) : std::string_view();
  return own.empty() ? binary_builder_summary(builder) : std::string(own);
}

}  // namespace arboretum
