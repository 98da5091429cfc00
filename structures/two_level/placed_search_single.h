// How a ray that was mapped into object space goes through each structure that can stand below (two_level::Searchable):
// the structure's own search, with its boxes or planes padded as the ray asks.
#pragma once

#include "structures/bih/bih_single.h"
#include "structures/bvh/bvh_single.h"
#include "structures/bvh4_aos/bvh4_aos_kernels.h"
#include "structures/bvh_quantised/bvh_quantised_kernels.h"
#include "structures/grid/grid_kernels.h"
#include "structures/kdtree/kdtree_single.h"
#include "structures/octree/octree_single.h"
#include "structures/two_level/placed_leaves_single.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// A ray in the object space of an instance; t is the world-space ray's. The derivation of its pad stands in
/// two_level_kernels.h.
struct PlacedRay : Ray {
  float pad;  ///< boxes are padded as if the structure's largest |coordinate| were larger by so much

  PlacedRay(const Ray& world, const two_level::Placed& instance, float last) : Ray(world) {
    tfar = last;
    if (!instance.identity) {
      origin = transform_point(instance.to_object, world.origin);
      direction = transform_direction(instance.to_object, world.direction);
    }
    pad = instance.pad + instance.pad_per_distance * largest_component(origin);
    // Beyond these the mapped ray says too little: with an infinite pad it meets every box.
    constexpr float kLeastDirection = 0x1p-100f, kMostPad = 0x1p100f;
    if (__builtin_expect(!(pad <= kMostPad && largest_component(direction) >= kLeastDirection && is_finite(direction)),
                         0))
      origin = {0, 0, 0}, direction = {1, 1, 1}, pad = std::numeric_limits<float>::infinity();
  }
};

template <bool AnyHit, template <bool> class Nodes, bool Padded, class Counting>
bool search_placed_bvh(const bvh::BvhBase& tree, const PlacedRay& ray, const PlacedLeaves& leaves, NearestHit& best,
                       const Counting& counting) {
  Nodes<Padded> nodes(ray, tree.max_coordinate() + ray.pad);
  TraversalStack stack(tree.stack_entries());
  return search_bvh<AnyHit>(tree.base(), tree.root(), nodes, stack.data(), ray, leaves, leaves.prepare(ray), best,
                            leaves.form(), counting);
}
template <bool AnyHit, bool Padded, int N, class Counting>
bool search_placed(const bvh::Bvh<N>& tree, const PlacedRay& ray, const PlacedLeaves& leaves, NearestHit& best,
                   const Counting& counting) {
  return search_placed_bvh<AnyHit, SoaTests<N>::template Nodes, Padded>(tree, ray, leaves, best, counting);
}
template <bool AnyHit, bool Padded, int N, class Counting>
bool search_placed(const bvh::WideBvh<bvh_quantised::QuantisedNodes<N>>& tree, const PlacedRay& ray,
                   const PlacedLeaves& leaves, NearestHit& best, const Counting& counting) {
  return search_placed_bvh<AnyHit, QuantisedTests<N>::template Nodes, Padded>(tree, ray, leaves, best, counting);
}
template <bool AnyHit, bool Padded, class Counting>
bool search_placed(const bvh4_aos::Bvh4Aos& tree, const PlacedRay& ray, const PlacedLeaves& leaves, NearestHit& best,
                   const Counting& counting) {
  return search_placed_bvh<AnyHit, AosNodeTest, Padded>(tree, ray, leaves, best, counting);
}

template <bool AnyHit, bool Padded, class Counting>
bool search_placed(const kdtree::KdTree& tree, const PlacedRay& ray, const PlacedLeaves& leaves, NearestHit& best,
                   const Counting& counting) {
  const KdRay planes(ray, tree.max_coordinate() + ray.pad, Padded ? KdRay::kPad : 0.0f);
  float begin = ray.tnear, end = best.t;
  planes.clip(tree.bounds(), begin, end);
  KdStack stack(tree.stack_entries());
  return !(begin > end) &&
         search_kdtree<AnyHit>(tree.base(), __builtin_bit_cast(std::uint64_t, tree.root()), begin, end, planes,
                               stack.data(), ray, leaves, leaves.prepare(ray), best, leaves.form(), counting);
}

template <bool AnyHit, bool Padded, class Counting>
bool search_placed(const bih::Bih& tree, const PlacedRay& ray, const PlacedLeaves& leaves, NearestHit& best,
                   const Counting& counting) {
  LeafVisits<PlacedLeaves, AnyHit, Counting> visits(tree.leaves(), leaves, leaves.form(), ray, best, counting);
  const IntervalRay interval(BoxRay<2, Padded>(ray, tree.max_coordinate() + ray.pad));
  float low = ray.tnear, high = best.t;
  clip_to_scene(tree, interval, low, high);
  IntervalStack stack(tree);
  return low <= high &&
         search_bih<AnyHit>(tree, interval, tree.nodes(), low, high, best, counting, stack.data(), visits);
}

template <bool AnyHit, bool Padded, class Counting>
bool search_placed(const octree::Octree& tree, const PlacedRay& ray, const PlacedLeaves& leaves, NearestHit& best,
                   const Counting& counting) {
  LeafVisits<PlacedLeaves, AnyHit, Counting> visits(tree.leaves(), leaves, leaves.form(), ray, best, counting);
  const OctreeRay box(BoxRay<8, Padded>(ray, tree.max_coordinate() + ray.pad));
  LeafCode last = kEmptyLeaf;
  return search_octree<AnyHit>(tree, box, {{0, 0, 0, 0}, tree.nodes()[0], 0}, ray.tnear, best, last, counting, visits);
}

/// Of the pad of a grid's cells (grid.h) more than 10 u M + 80 u L are left for a ray that is mapped: what the walk's
/// roundings take is 2 u M + 136 u L, what those of the ray's own numbers u (M + 2 |o|), |o| <= M + 16 L.
template <bool AnyHit, bool Padded, class Counting>
bool search_placed(const grid::Grid& grid, const PlacedRay& ray, const PlacedLeaves& leaves, NearestHit& best,
                   const Counting& counting) {
  LeafVisits<PlacedLeaves, AnyHit, Counting> visits(grid.leaves(), leaves, leaves.form(), ray, best, counting);
  if constexpr (Padded) {
    if (!(8.0f * ray.pad <= 10.0f * grid.max_coordinate() + 80.0f * grid.reach() && within_walk_bounds(grid, ray))) {
      auto leaf = [&](LeafCode code) { return visits(code); };
      return FarWalk(grid, ray, grid.max_coordinate() + ray.pad, best.t, leaf).search(grid.levels()[0]);
    }
  }
  NoScratch scratch(grid);
  return GridSingle<false, Counting>::template trace<AnyHit>(grid, ray, best, counting, scratch, visits);
}

template <bool AnyHit, bool, class Counting>
bool search_placed(const brute_force::BruteForce& all, const PlacedRay& ray, const PlacedLeaves& leaves,
                   NearestHit& best, const Counting& counting) {
  if constexpr (AnyHit)
    return any_hit_in_leaf(leaves, leaves.prepare(ray), leaves.form(), counting, all.base(), all.block_count(),
                           ray.tnear, ray.tfar);
  counting.leaf(leaves.form(), all.base(), all.block_count());
  leaves.closest_hit(leaves.prepare(ray), all.base(), all.block_count(), ray.tnear, best);
  return false;
}

/// Of a structure that is searchable: any hit returns whether there is one, closest hit updates `best`.
template <class Counting>
using PlacedSearch = bool (*)(const Accel& below, const PlacedRay& ray, const PlacedLeaves& leaves, NearestHit& best,
                              const Counting& counting);

/// nullptr for a structure that is none of two_level::Searchable.
template <bool AnyHit, bool Padded, class Counting>
PlacedSearch<Counting> find_search(std::string_view below) {
  PlacedSearch<Counting> found = nullptr;
  for_each_type(two_level::Searchable{}, [&]<class S>(std::type_identity<S>) {
    if (S::kName != below) return;
    found = [](const Accel& accel, const PlacedRay& ray, const PlacedLeaves& leaves, NearestHit& best,
               const Counting& counting) {
      return search_placed<AnyHit, Padded>(static_cast<const S&>(accel), ray, leaves, best, counting);
    };
  });
  return found;
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
