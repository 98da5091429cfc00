// The cells that `verify` traces, of the axes on its command line.
#pragma once

#include "experiments/commands.h"
#include "experiments/plan.h"

namespace arboretum {

/// Axes that the command does not name, or names `all`, have every value that this machine can trace; builder, leaf and
/// box those that suit each structure, traversal `single`. `without_brute_force`: unless it is asked for. The skipped
/// have no names. Throws UserError.
[[nodiscard]] Plan make_verify_plan(const VerifyCommand& command, const SceneChoice& scene, bool without_brute_force,
                                    const Registry& registry);

}  // namespace arboretum
