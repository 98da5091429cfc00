// two_level: a BVH over instances, and for each prototype one structure of any other kind (BuilderParameters::below).
// Rays search that structure in object space, and its triangles are tested in world space as the flat mesh has them, so
// that answers are those of a structure over the flat mesh, bit for bit (two_level_kernels.h). A scene without
// instances is answered by the structure below.
//
// Bytes: the top (four-wide nodes, 16 bytes a leaf), 128 an instance, and each prototype's structure once.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "core/error.h"
#include "core/instances.h"
#include "core/memory_meter.h"
#include "core/type_list.h"
#include "structures/accel.h"
#include "structures/bih/bih.h"
#include "structures/brute_force/brute_force.h"
#include "structures/bvh/bvh.h"
#include "structures/bvh4_aos/bvh4_aos.h"
#include "structures/bvh_quantised/bvh_quantised.h"
#include "structures/grid/grid.h"
#include "structures/kdtree/kdtree.h"
#include "structures/octree/octree.h"

namespace arboretum::two_level {

/// What kernels can search for a ray that was mapped (placed_search_single.h). Over a scene without instances any
/// structure may stand below.
using Searchable = ConcatLists<bvh::Structures, bvh4_aos::Structures, bvh_quantised::Structures, kdtree::Structures,
                               grid::Structures, octree::Structures, bih::Structures, brute_force::Structures>;

/// An instance as rays meet it.
struct alignas(64) Placed {
  AffineMap to_object;
  const AffineMap* to_world = nullptr;
  const Accel* below = nullptr;
  std::uint32_t first_primitive = 0;
  /// Boxes in object space are padded as if coordinates were larger by pad + pad_per_distance * |o|, o the largest
  /// |coordinate| of the mapped origin (two_level_kernels.h).
  float pad = 0.0f, pad_per_distance = 0.0f;
  bool identity = true;
  /// The flat mesh's corners are those of transform_point(), bit for bit, and the same triangles have no area.
  bool laid_out = false;
};
static_assert(sizeof(Placed) == 128);

class TwoLevel final : public Accel {
 public:
  static constexpr std::string_view kName = "two_level";

  [[nodiscard]] static const StructureInfo& static_info();
  [[nodiscard]] const StructureInfo& info() const noexcept override { return static_info(); }
  /// The builder axis goes to the structures below; the top takes it too where it builds binary trees, else binned_sah.
  /// Throws UserError for a structure below that there is not, that lacks the builder or leaf, or that cannot stand
  /// there (why_not_below(), over instances also one that is not Searchable), and for a map that takes its prototype's
  /// box beyond float.
  void build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) override;
  void archive(Archive& archive) override;
  /// The top's nodes, then each instance's nodes and leaves with boxes in world space; bytes of a prototype count where
  /// it is shown first. False where the structure below cannot be looked into.
  [[nodiscard]] bool visit(StructureVisitor& visitor) const override;
  [[nodiscard]] std::size_t bytes() const noexcept override;

  [[nodiscard]] const bvh::Bvh4& top() const noexcept { return top_; }
  /// The instances that have triangles; the top's leaves name them.
  [[nodiscard]] const MeteredVector<Placed>& placed() const noexcept { return placed_; }
  /// The structure below, where the scene has no instances and is that structure; else nullptr.
  [[nodiscard]] const Accel* only() const noexcept {
    return mesh_->instancing || placed_.empty() ? nullptr : placed_[0].below;
  }
  [[nodiscard]] const TriangleMesh& mesh() const noexcept { return *mesh_; }
  [[nodiscard]] const std::string& below() const noexcept { return below_; }
  [[nodiscard]] const std::string& leaf() const noexcept { return leaf_; }

 private:
  /// The mesh that prototypes_[i] is built over.
  [[nodiscard]] const TriangleMesh& prototype(std::size_t i) const;
  /// Makes placed_; calls set_box(i, bounds in the flat mesh) for instance i, from several threads.
  template <class SetBox>
  void place(const SetBox& set_box);

  const TriangleMesh* mesh_ = nullptr;
  std::string below_, leaf_;
  bvh::Bvh4 top_;
  std::vector<std::unique_ptr<Accel>> prototypes_;
  MeteredVector<Placed> placed_;
};

using Structures = TypeList<TwoLevel>;

}  // namespace arboretum::two_level
