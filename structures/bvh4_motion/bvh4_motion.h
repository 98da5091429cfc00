// bvh4_motion: a four-wide BVH of a mesh that moves: one tree for all times, whose boxes move linearly from time 0 to
// time 1. After BVH4MB of Embree (Woop, Benthin, Wald, SIGGRAPH 2013 talk); there a pair of key frames has a tree of
// its own, here one tree holds any number of them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "core/type_list.h"
#include "structures/accel.h"
#include "structures/bvh/bvh.h"

namespace arboretum::bvh4_motion {

/// Planes as in bvh::Node, at time 0; how far each moves until time 1; children as in structures/bvh/bvh.h. A slot
/// without a child has lower = +inf, upper = -inf, and stands still. 224 bytes.
struct alignas(32) Node {
  float planes[6][4];
  float motion[6][4];
  bvh::NodeReference child[4];
};
static_assert(sizeof(Node) == 224);

/// A box whose planes move linearly: `at0` at time 0, `at1` at time 1.
struct LinearBounds {
  Bounds3f at0, at1;
  void extend(const LinearBounds& b) noexcept { at0.extend(b.at0), at1.extend(b.at1); }
};

/// Holds the triangle at every time, as core/motion.h rounds its corners (the proof stands in bvh4_motion.cpp).
[[nodiscard]] LinearBounds linear_bounds(const TriangleMesh& mesh, std::uint32_t triangle) noexcept;

class Bvh4Motion final : public bvh::BvhBase {
 public:
  static constexpr std::string_view kName = "bvh4_motion";

  [[nodiscard]] static const StructureInfo& static_info();
  [[nodiscard]] const StructureInfo& info() const noexcept override { return static_info(); }
  /// The tree is that of bvh4 over the mesh at time 0.5. A mesh that stands still is taken as one that could move.
  void build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) override;
  void archive(Archive& archive) override;
  /// Boxes as they are at time 0.5.
  [[nodiscard]] bool visit(StructureVisitor& visitor) const override;
  [[nodiscard]] const TriangleMesh& mesh() const noexcept { return *mesh_; }

 private:
  /// The base's bounds are those at time 0.5, its max_coordinate() is for any time.
  const TriangleMesh* mesh_ = nullptr;
};

using Structures = TypeList<Bvh4Motion>;

}  // namespace arboretum::bvh4_motion
