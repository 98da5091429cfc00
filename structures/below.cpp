#include "structures/below.h"

#include <string>

#include "core/error.h"
#include "core/names.h"

namespace arboretum {

std::vector<std::string_view> names_below() {
  std::vector<std::string_view> names;
  for (const StructureEntry& e : all_structures())
    if (why_not_below(e.info).empty()) names.push_back(e.info.name);
  return names;
}

void check_below(const StructureInfo& above, std::string_view below) {
  const StructureEntry* entry = find_structure(below);
  if (!entry && !above.takes_below && below == BuilderParameters{}.below) return;  // of a program without that one
  if (!entry) {
    const std::vector<std::string_view> names = names_below();
    throw UserError("below: " +
                    unknown_name_message("structure", below, std::vector<std::string>(names.begin(), names.end())));
  }
  if (!above.takes_below) return;
  if (const std::string why = why_not_below(entry->info); !why.empty())
    throw UserError(std::string(above.name) + " over " + std::string(below) + ": " + why);
}

}  // namespace arboretum
