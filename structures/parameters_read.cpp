#include "structures/parameters_read.h"

#include <algorithm>

#include "core/error.h"
#include "core/names.h"
#include "structures/builders/builder_parameters.h"
#include "structures/registry.h"

namespace arboretum {

void check_names_read(const StructureInfo& info, const StructureBuilders& builders) {
  if (!builders.reads) return;
  std::vector<std::string> names;
  for (const auto& parameter : builder_parameter_table()) names.emplace_back(parameter.name);
  for (const OwnParameter& parameter : builders.own) names.emplace_back(parameter.name);
  for (std::string_view builder : info.builders)
    for (std::string_view name : builders.reads(builder))
      if (std::ranges::find(names, name) == names.end())
        throw UserError(std::string(info.name) + ": its builder " + std::string(builder) + " says that it reads an " +
                        unknown_name_message("parameter", name, names));
}

const StructureBuilders* builders_of_structure(std::string_view structure) {
  static const std::vector<StructureBuilders> declared = [] {
    std::vector<StructureBuilders> list = registered_builders();  // in the order of all_structures()
    for (std::size_t i = 0; i < list.size(); ++i) check_names_read(all_structures()[i].info, list[i]);
    return list;
  }();
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
