// The leaves and intersectors that kernels have compiled in (traversal/leaves.h): those that a cell uses when its
// configuration names no leaf.
#pragma once

#include "intersectors/exact.h"
#include "intersectors/moller_trumbore.h"
#include "intersectors/pluecker.h"
#include "intersectors/watertight.h"
#include "traversal/leaves.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// None for scalar kernels, which are the reference and not a race.
using UsualLeaves = std::conditional_t<
    kRegisterWidth == 1, TypeList<>,
    std::conditional_t<
        kRegisterWidth == 4,
        TypeList<CompiledLeaves<EdgeBlock<4>, MollerTrumbore>, CompiledLeaves<VertexBlock<4>, Watertight>,
                 CompiledLeaves<VertexBlock<4>, Exact>, CompiledLeaves<VertexBlock<4>, Pluecker>>,
        TypeList<CompiledLeaves<EdgeBlock<4>, MollerTrumbore>, CompiledLeaves<EdgeBlock<8>, MollerTrumbore>,
                 CompiledLeaves<VertexBlock<8>, Watertight>, CompiledLeaves<VertexBlock<8>, Exact>,
                 CompiledLeaves<VertexBlock<8>, Pluecker>>>>;

/// What ways of traversal for many rays have compiled in: packets, rays in flight.
using BatchLeaves = std::conditional_t<
    kRegisterWidth == 1, TypeList<>,
    std::conditional_t<kRegisterWidth == 4,
                       TypeList<CompiledLeaves<EdgeBlock<4>, MollerTrumbore>,
                                CompiledLeaves<VertexBlock<4>, Watertight>, CompiledLeaves<VertexBlock<4>, Exact>>,
                       TypeList<CompiledLeaves<EdgeBlock<8>, MollerTrumbore>,
                                CompiledLeaves<VertexBlock<8>, Watertight>, CompiledLeaves<VertexBlock<8>, Exact>>>>;

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
