// How long cells are likely to take: for the time estimate of a run, and to cut a plan into shards of equal length.
// Rough, of a machine that does nothing else, and the same on every machine: it knows the configuration and the
// catalogue, and looks at no file. Figures and the report come on top.
#pragma once

#include <cstddef>
#include <functional>
#include <vector>

#include "experiments/cell.h"
#include "experiments/config.h"

namespace arboretum {

/// Seconds that each of the cells takes, with its part of what cells need together: the scene, the exact answers to its
/// rays, the structure. `measured`: how many repetitions a cell has already.
[[nodiscard]] std::vector<double> estimate_seconds(const Experiment& experiment, const std::vector<Cell>& cells,
                                                   const std::function<std::size_t(const Cell&)>& measured = {});

}  // namespace arboretum
