// The effective configuration: every default filled in, fit to be run again, and its hash.
#pragma once

#include <string>

#include "experiments/config.h"

namespace arboretum {

/// YAML text. Two experiments with equal texts measure the same cells in the same way.
[[nodiscard]] std::string effective_yaml(const Experiment& experiment);
/// 16 hexadecimal digits (FNV-1a, 64 bits) over what of effective_yaml changes a measured number: not plots, nor the
/// folders that scenes are found in, whose files are told by their names and by hashes of what they hold (plan.json).
[[nodiscard]] std::string configuration_hash(const Experiment& experiment);

}  // namespace arboretum
