// two_level: a BVH over instances, and for each prototype one structure of any other kind (BuilderParameters::below). A
// scene without instances is one instance with the identity, and is answered by the structure below bit for bit.
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
#include "structures/bvh/bvh.h"

namespace arboretum::two_level {

/// An instance as rays meet it.
struct alignas(64) Placed {
  AffineMap to_object;
  const Accel* below = nullptr;
  std::uint32_t first_primitive = 0;
  bool identity = true;
  float max_coordinate = 0.0f;  ///< largest |coordinate| in object space
};
static_assert(sizeof(Placed) == 128);

class TwoLevel final : public Accel {
 public:
  static constexpr std::string_view kName = "two_level";

  [[nodiscard]] static const StructureInfo& static_info();
  [[nodiscard]] const StructureInfo& info() const noexcept override { return static_info(); }
  /// The builder axis goes to the structures below; the top takes it too where it builds binary trees, else binned_sah.
  /// Throws UserError for a structure below that there is not, that lacks the builder or leaf, or that cannot stand
  /// there (why_not_below()), and for a map that takes its prototype's box beyond float.
  void build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) override;
  void archive(Archive& archive) override;
  /// The top's nodes, then each instance's nodes and leaves with boxes in world space; bytes of a prototype count where
  /// it is shown first. False where the structure below cannot be looked into.
  [[nodiscard]] bool visit(StructureVisitor& visitor) const override;
  [[nodiscard]] std::size_t bytes() const noexcept override;

  [[nodiscard]] const bvh::Bvh4& top() const noexcept { return top_; }
  /// The instances that have triangles; the top's leaves name them.
  [[nodiscard]] const MeteredVector<Placed>& placed() const noexcept { return placed_; }
  [[nodiscard]] const TriangleMesh& mesh() const noexcept { return *mesh_; }
  [[nodiscard]] const std::string& below() const noexcept { return below_; }
  [[nodiscard]] const std::string& leaf() const noexcept { return leaf_; }
  /// Largest condition() of an instance's map; 0 where all are the identity.
  [[nodiscard]] float magnification() const noexcept { return magnification_; }
  /// Largest |coordinate| of the scene plus twice that of any translation.
  [[nodiscard]] float reach() const noexcept { return reach_; }

 private:
  /// The mesh that prototypes_[i] is built over.
  [[nodiscard]] const TriangleMesh& prototype(std::size_t i) const;
  /// Makes placed_; calls set_box(i, bounds in world space) for instance i, from several threads.
  template <class SetBox>
  void place(const std::vector<Instance>& instances, const SetBox& set_box);

  const TriangleMesh* mesh_ = nullptr;
  std::string below_, leaf_;
  bvh::Bvh4 top_;
  std::vector<std::unique_ptr<Accel>> prototypes_;
  MeteredVector<Placed> placed_;
  float magnification_ = 0.0f, reach_ = 0.0f, scene_size_ = 0.0f;
};

using Structures = TypeList<TwoLevel>;

}  // namespace arboretum::two_level
