// The `context` of results.json: the machine, the build, the revision and the configuration that figures come
// from.
#pragma once

#include <string>

#include "experiments/config.h"
#include "experiments/result.h"

namespace arboretum {

/// Google Benchmark's own context fields and ours. `command` is the command line as typed.
[[nodiscard]] Json machine_context(const Experiment& experiment, const std::string& configuration_hash,
                                   const std::string& command);

}  // namespace arboretum
