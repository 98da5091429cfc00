// The kd-tree's builders: planes from bins, or from every bound of a triangle's part.
#pragma once

#include "structures/kdtree/top_down.h"

namespace arboretum::kdtree {

/// Builds the tree of a mesh that is not empty, `cell` being its bounds, as `pads` widen them. Deterministic: neither
/// threads nor ISA matter. Runs in the caller's TBB arena.
using Builder = void (*)(const TriangleMesh& mesh, const BoxPads& pads, const BuilderParameters& parameters,
                         const CostModel& model, const Limits& limits, const Bounds3f& cell, Part& out,
                         BuildReport& report);

void build_binned(const TriangleMesh& mesh, const BoxPads& pads, const BuilderParameters& parameters,
                  const CostModel& model, const Limits& limits, const Bounds3f& cell, Part& out, BuildReport& report);
void build_sweep(const TriangleMesh& mesh, const BoxPads& pads, const BuilderParameters& parameters,
                 const CostModel& model, const Limits& limits, const Bounds3f& cell, Part& out, BuildReport& report);

/// Every triangle's box, as `pads` widen it, in order.
[[nodiscard]] References make_references(const TriangleMesh& mesh, const BoxPads& pads);

}  // namespace arboretum::kdtree
