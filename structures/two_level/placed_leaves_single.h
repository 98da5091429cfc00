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

/// Tests blocks of one instance after the other with rays in world space.
class PlacedBlocks {
 public:
  PlacedBlocks(const LeafTests& tests, const TriangleMesh& flat) : tests_(&tests), flat_(&flat) {
    for_each_type(EveryWidth<VertexBlock>{}, [&]<class Block>(std::type_identity<Block>) {
      if (Block::kName == tests.leaf) map_ = &map_vertices<Block::kWidth>;
    });
  }

  void enter(const two_level::Placed& instance) { instance_ = &instance; }
  [[nodiscard]] const LeafTests& tests() const { return *tests_; }
  [[nodiscard]] const LeafForm& form() const { return *tests_->form; }

  /// Calls test(block of the flat mesh) for each of `count` blocks until it returns true; whether it did.
  template <class Test>
  bool any_of(const std::byte* blocks, unsigned count, const Test& test) {
    alignas(64) std::byte flat[kLargestBlock];
    for (; count > 0; --count, blocks += form().bytes) {
      make_flat(blocks, flat);
      if (test(flat)) return true;
    }
    return false;
  }
  bool closest_hit(PreparedRay& ray, const std::byte* block, float tnear, NearestHit& best) const {
    return tests_->closest_hit(ray, block, 1, flat_->vertices.data(), tnear, best);
  }
  bool any_hit(PreparedRay& ray, const std::byte* block, float tnear, float tfar) const {
    return tests_->any_hit(ray, block, 1, flat_->vertices.data(), tnear, tfar);
  }

 private:
  void make_flat(const std::byte* block, std::byte* to) {
    if (map_ && instance_->laid_out) return map_(block, *instance_, to);
    ids_.clear();
    form().append(block, 1, ids_);
    for (std::uint32_t& id : ids_) id += instance_->first_primitive;
    form().fill(to, *flat_, ids_);
  }

  const LeafTests* tests_;
  const TriangleMesh* flat_;
  void (*map_)(const std::byte*, const two_level::Placed&, std::byte*) = nullptr;
  const two_level::Placed* instance_ = nullptr;
  std::vector<std::uint32_t> ids_;
};

/// Leaves (traversal/leaves.h) of an instance for one ray, which stands prepared as it is in world space, whatever ray
/// searches the structure.
class PlacedLeaves {
 public:
  using RayData = PreparedRay&;
  static constexpr bool kRaysInLanes = false, kBlockByBlock = false;

  PlacedLeaves(PlacedBlocks& blocks, PreparedRay& ray) : blocks_(blocks), ray_(ray) {}
  [[nodiscard]] const LeafForm& form() const { return blocks_.form(); }
  [[nodiscard]] std::size_t block_bytes() const { return form().bytes; }

  RayData prepare(const Ray&) const { return ray_; }
  bool closest_hit(RayData ray, const std::byte* blocks, unsigned count, float tnear, NearestHit& best) const {
    bool changed = false;
    blocks_.any_of(blocks, count, [&](const std::byte* flat) {
      changed |= blocks_.closest_hit(ray, flat, tnear, best);
      return false;
    });
    return changed;
  }
  bool any_hit(RayData ray, const std::byte* blocks, unsigned count, float tnear, float tfar) const {
    return blocks_.any_of(blocks, count,
                          [&](const std::byte* flat) { return blocks_.any_hit(ray, flat, tnear, tfar); });
  }

 private:
  PlacedBlocks& blocks_;
  PreparedRay& ray_;
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
