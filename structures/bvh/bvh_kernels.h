// The kernels of the wide BVHs: which leaf blocks, intersectors and ways of traversal each has on this instruction set.
#pragma once

#include "intersectors/moller_trumbore.h"
#include "intersectors/pluecker.h"
#include "intersectors/watertight.h"
#include "structures/bvh/bvh_queued.h"
#include "structures/bvh/bvh_single.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <int N>
struct SoaTests {
  template <bool Padded>
  using Nodes = SoaNodeTest<N, Padded>;
};

template <int N>
void add_kernels(std::type_identity<bvh::Bvh<N>>, KernelRows& rows) {
  constexpr std::string_view name = bvh::Bvh<N>::kName;
  constexpr int kDefaultWidth = kRegisterWidth < 8 ? 4 : 8;
  using Single = SingleRayKernels<SoaTests<N>::template Nodes>;
  using Edges = BlocksOfWidth<EdgeBlock, kRegisterWidth>;
  using Vertices = BlocksOfWidth<VertexBlock, kRegisterWidth>;
  // The full leaf axis for the fastest and the crack-free intersector; else the default leaf (compile time).
  add_rows<Single::template Maker>(rows, name, "single", kIsa, Edges{}, TypeList<MollerTrumbore>{});
  add_rows<Single::template Maker>(rows, name, "single", kIsa, Vertices{}, TypeList<Watertight>{});
  add_rows<Single::template Maker>(rows, name, "single", kIsa, TypeList<VertexBlock<4>>{}, TypeList<MollerTrumbore, Pluecker>{});
  add_rows<Single::template Maker>(rows, name, "single", kIsa, BlocksOfWidth<IndexBlock, kRegisterWidth>{}, TypeList<Watertight>{});
  add_rows<Single::template Maker>(rows, name, "single", kIsa, TypeList<IndexBlock<4>>{}, TypeList<MollerTrumbore>{});
  add_queued_rows<N>(rows, name, TypeList<EdgeBlock<kDefaultWidth>>{}, TypeList<MollerTrumbore>{});
  add_queued_rows<N>(rows, name, TypeList<VertexBlock<kDefaultWidth>>{}, TypeList<Watertight>{});
  add_queued_rows<N>(rows, name, TypeList<VertexBlock<4>>{}, TypeList<Pluecker>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
