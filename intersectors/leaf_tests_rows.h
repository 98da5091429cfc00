// Entries of the table of leaf tests for one intersector on one instruction set. Units are generated
// (cmake/Intersectors.cmake).
#pragma once

#include "intersectors/leaf_block.h"

namespace arboretum {

/// An intersector can read a block's form, or that which readable() makes of it.
template <class Intersector, class Block>
inline constexpr bool kCanRead = Intersector::reads(Block::kForm == TriangleForm::indices ? TriangleForm::vertices
                                                                                          : Block::kForm);

/// An intersector that says so: what it hits is as far away, along the axis where the direction is largest, as some
/// point between the triangle's corners, and all that it misjudges is where the ray passes across that axis
/// (traversal/box_test.h).
template <class Intersector>
inline constexpr bool kDepthBetweenCorners = requires {
  requires Intersector::kDepthBetweenCorners;
};

namespace ARBORETUM_ISA_NAMESPACE {

template <class Intersector, class Block>
struct CalledTests {
  using RayData = typename Intersector::RayData;
  static_assert(sizeof(RayData) <= PreparedRay::kBytes && std::is_trivially_destructible_v<RayData>);

  static RayData& data(PreparedRay& ray) { return *reinterpret_cast<RayData*>(ray.bytes); }
  static void prepare(const Ray& ray, PreparedRay& prepared) { new (prepared.bytes) RayData(ray); }
  static bool closest_hit(PreparedRay& ray, const std::byte* blocks, unsigned count, const Vec3f* vertices, float tnear,
                          NearestHit& best) {
    return BlockTests<Intersector, Block>::closest_hit(data(ray), blocks, count, vertices, tnear, best);
  }
  static bool any_hit(PreparedRay& ray, const std::byte* blocks, unsigned count, const Vec3f* vertices, float tnear,
                      float tfar) {
    return BlockTests<Intersector, Block>::any_hit(data(ray), blocks, count, vertices, tnear, tfar);
  }
  static void finish(PreparedRay& ray, NearestHit& best) {
    if constexpr (kFinishes<Intersector>) Intersector::finish(data(ray), best);
  }
};

/// The blocks that an intersector is compiled for.
template <class Intersector>
using BlocksOf = std::conditional_t<
    Intersector::kEveryLeaf,
    ConcatLists<BlocksOfWidth<EdgeBlock, kRegisterWidth>, BlocksOfWidth<VertexBlock, kRegisterWidth>,
                BlocksOfWidth<IndexBlock, kRegisterWidth>, BlocksOfWidth<TransformBlock, kRegisterWidth>,
                BlocksOfWidth<PlaneBlock, kRegisterWidth>, BlocksOfWidth<ProjectionBlock, kRegisterWidth>,
                TypeList<AosBlock>>,
    std::conditional_t<(kRegisterWidth >= 8), TypeList<VertexBlock<1>, VertexBlock<4>, VertexBlock<8>, IndexBlock<4>>,
                       TypeList<VertexBlock<1>, VertexBlock<4>, IndexBlock<4>>>>;

template <class Intersector, class... Blocks>
constexpr bool reads_any_of(TypeList<Blocks...>) {
  return (kCanRead<Intersector, Blocks> || ...);
}

template <class Block, class... Compiled>
constexpr bool has_form_of(TypeList<Compiled...>) {
  return ((Compiled::kForm == Block::kForm) || ...);
}
template <class Intersector, class... Blocks>
constexpr bool has_every_form(TypeList<Blocks...>) {
  return ((!kCanRead<Intersector, Blocks> || has_form_of<Blocks>(BlocksOf<Intersector>{})) && ...);
}

template <class Intersector>
void add_leaf_tests(std::vector<LeafTests>& list) {
  static_assert(reads_any_of<Intersector>(AllBlocks{}), "It reads none of the blocks that there are.");
  static_assert(has_every_form<Intersector>(AllBlocks{}),
                "It reads a form of blocks that it is not compiled for: without kEveryLeaf it may read vertices and "
                "indices alone, with it a form that is new stands in BlocksOf as well.");
  for_each_type(BlocksOf<Intersector>{}, [&]<class Block>(std::type_identity<Block>) {
    if constexpr (kCanRead<Intersector, Block>) {
      using T = CalledTests<Intersector, Block>;
      list.push_back({Block::kName, Intersector::kName, kIsa, nullptr, &T::prepare, &T::closest_hit, &T::any_hit,
                      kFinishes<Intersector> ? &T::finish : nullptr, kDepthBetweenCorners<Intersector>});
    }
  });
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
