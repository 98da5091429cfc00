// The effective configuration: every default filled in, fit to be run again, and its hash.
#pragma once

#include <string>

#include "experiments/config.h"

namespace arboretum {

/// YAML text. Two experiments with equal texts measure the same cells in the same way.
[[nodiscard]] std::string effective_yaml(const Experiment& experiment);
/// 16 hexadecimal digits over effective_yaml (FNV-1a, 64 bits). Plots and the folders that scenes are found in do not
/// count: they change nothing measured.
[[nodiscard]] std::string configuration_hash(const Experiment& experiment);

}  // namespace arboretum
