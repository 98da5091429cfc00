// What is said of a cell whose instruction set the machine lacks, in one wording: summaries look for it.
#pragma once

#include <string>

#include "core/isa.h"

namespace arboretum {

[[nodiscard]] inline std::string missing_isa_reason(Isa isa) { return "no " + std::string(to_string(isa)); }

}  // namespace arboretum
