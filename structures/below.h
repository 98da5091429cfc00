// What can stand below a structure that takes another one (StructureInfo::takes_below): BuilderParameters::below.
#pragma once

#include <string_view>
#include <vector>

#include "structures/accel.h"

namespace arboretum {

/// The structures that can stand below, in the order of all_structures().
[[nodiscard]] std::vector<std::string_view> names_below();
/// Throws UserError for a name that is no structure's, whether or not `above` takes one below it (where it does not,
/// the default may be missing, as in programs without it); where it does, also for one that cannot stand there, with
/// the reason (why_not_below()).
void check_below(const StructureInfo& above, std::string_view below);

}  // namespace arboretum
