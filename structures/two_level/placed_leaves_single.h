// The leaves of a structure in object space, tested in world space: each block is made anew with the triangles as the
// flat mesh has them, in registers where it holds vertices and the flat mesh is what transform_point() makes, else from
// the flat mesh. Intersectors then see numbers and ids that a structure over the flat mesh would show them, and one
// prepared ray goes through all instances.
#pragma once

#include "simd/double.h"
#include "traversal/leaves.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// The operations of transform_point() in their order.
template <int D>
ARBORETUM_INLINE vd<D> mapped_coordinate(const double (&row)[4], const vd3<D>& p) {
  return ((vd<D>(row[0]) * p.x + vd<D>(row[1]) * p.y) + vd<D>(row[2]) * p.z) + vd<D>(row[3]);
}

/// Makes a VertexBlock<M> of the flat mesh from one in object space. NaN, where a lane is empty, stays NaN.
template <int M>
void map_vertices(const std::byte* from, const two_level::Placed& instance, std::byte* to) {
  constexpr int D = kDoubleLanes<M>;
  const auto& object = *reinterpret_cast<const VertexBlock<M>*>(from);
  auto& flat = *new (to) VertexBlock<M>;
  if (instance.identity) {
    flat = object;
  } else {
    const AffineMap& map = *instance.to_world;
    const auto corner = [&](const float(&p)[3][M], float(&q)[3][M]) {
      for (int k = 0; k < M; k += D) {
        const vd3<D> v = load3<D>(p[0] + k, p[1] + k, p[2] + k);
        for (int axis = 0; axis < 3; ++axis) mapped_coordinate<D>(map.m[axis], v).store(q[axis] + k);
      }
    };
    corner(object.v0, flat.v0), corner(object.v1, flat.v1), corner(object.v2, flat.v2);
  }
  for (int i = 0; i < M; ++i)
    flat.id[i] = object.id[i] == kNoPrimitive ? kNoPrimitive : object.id[i] + instance.first_primitive;
}

/// Leaves (traversal/leaves.h) of one instance after the other, for one world-space ray.
class PlacedLeaves {
 public:
  using RayData = PreparedRay&;
  static constexpr bool kRaysInLanes = false, kBlockByBlock = false;

  PlacedLeaves(const LeafTests& tests, const TriangleMesh& flat) : tests_(tests), flat_(flat) {
    for_each_type(EveryWidth<VertexBlock>{}, [&]<class Block>(std::type_identity<Block>) {
      if (Block::kName == tests.leaf) map_ = &map_vertices<Block::kWidth>;
    });
  }
  PlacedLeaves(const PlacedLeaves&) = delete;
  PlacedLeaves& operator=(const PlacedLeaves&) = delete;

  void begin(const Ray& world) { tests_.prepare(world, ray_); }
  void enter(const two_level::Placed& instance) { instance_ = &instance; }
  void finish(NearestHit& best) {
    if (tests_.finish && best.primitive != NearestHit::kNone) tests_.finish(ray_, best);
  }
  [[nodiscard]] const LeafForm& form() const { return *tests_.form; }

  /// The world-space ray's, whatever ray searches the structure.
  RayData prepare(const Ray&) const { return ray_; }
  bool closest_hit(RayData data, const std::byte* blocks, unsigned count, float tnear, NearestHit& best) const {
    bool changed = false;
    alignas(64) std::byte flat[kLargestBlock];
    for (; count > 0; --count, blocks += block_bytes()) {
      make_flat(blocks, flat);
      changed |= tests_.closest_hit(data, flat, 1, flat_.vertices.data(), tnear, best);
    }
    return changed;
  }
  bool any_hit(RayData data, const std::byte* blocks, unsigned count, float tnear, float tfar) const {
    alignas(64) std::byte flat[kLargestBlock];
    for (; count > 0; --count, blocks += block_bytes()) {
      make_flat(blocks, flat);
      if (tests_.any_hit(data, flat, 1, flat_.vertices.data(), tnear, tfar)) return true;
    }
    return false;
  }
  [[nodiscard]] std::size_t block_bytes() const { return tests_.form->bytes; }

 private:
  void make_flat(const std::byte* block, std::byte* to) const {
    if (map_ && instance_->laid_out) return map_(block, *instance_, to);
    ids_.clear();
    tests_.form->append(block, 1, ids_);
    for (std::uint32_t& id : ids_) id += instance_->first_primitive;
    tests_.form->fill(to, flat_, ids_);
  }

  const LeafTests& tests_;
  const TriangleMesh& flat_;
  void (*map_)(const std::byte*, const two_level::Placed&, std::byte*) = nullptr;
  const two_level::Placed* instance_ = nullptr;
  mutable PreparedRay ray_;
  mutable std::vector<std::uint32_t> ids_;
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
