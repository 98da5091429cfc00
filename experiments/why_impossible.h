// Why a combination of the axes cannot be measured anywhere: structures, builders, kernels and their settings that do
// not go together.
#pragma once

#include <string>

#include "experiments/cell.h"
#include "experiments/registry.h"

namespace arboretum {

/// Empty where the cell can be; it then gets its kernel. `moves`: the scene does.
[[nodiscard]] std::string why_impossible(Cell& cell, bool moves, const Registry& registry);

}  // namespace arboretum
