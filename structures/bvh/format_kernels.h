// The rows of a node format beside the plain one: what bvh8 and its like have, without the rarer leaves (compile time).
#pragma once

#include "intersectors/moller_trumbore.h"
#include "intersectors/pluecker.h"
#include "intersectors/watertight.h"
#include "structures/bvh/bvh_single.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <template <bool> class Nodes>
void add_format_rows(std::string_view structure, KernelRows& rows) {
  constexpr bool kEight = kRegisterWidth >= 8;
  using Edges = std::conditional_t<kEight, TypeList<EdgeBlock<4>, EdgeBlock<8>>, TypeList<EdgeBlock<4>>>;
  using Vertices = std::conditional_t<kEight, TypeList<VertexBlock<4>, VertexBlock<8>>, TypeList<VertexBlock<4>>>;
  using Single = SingleRayKernels<Nodes>;
  add_rows<Single::template Maker>(rows, structure, "single", kIsa, Edges{}, TypeList<MollerTrumbore>{});
  add_rows<Single::template Maker>(rows, structure, "single", kIsa, Vertices{}, TypeList<Watertight>{});
  add_rows<Single::template Maker>(rows, structure, "single", kIsa, TypeList<VertexBlock<4>>{}, TypeList<MollerTrumbore, Pluecker>{});
  add_rows<Single::template Maker>(rows, structure, "single", kIsa, TypeList<IndexBlock<4>>{}, TypeList<Watertight>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
