// brute_force: no structure at all. One leaf holds every triangle, in the mesh's order, and every ray tests
// every block. What the other structures are compared with: the same blocks and intersectors, so the same
// rounding, and no box test.
#pragma once

#include <cstddef>
#include <string>

#include "core/arena.h"
#include "core/type_list.h"
#include "structures/accel.h"

namespace arboretum::brute_force {

class BruteForce final : public Accel {
 public:
  static constexpr std::string_view kName = "brute_force";

  [[nodiscard]] static const StructureInfo& static_info();
  [[nodiscard]] const StructureInfo& info() const noexcept override { return static_info(); }
  /// O(n) on the calling thread, whatever settings.threads is. Throws UserError above 2^31 - 2 triangles.
  void build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) override;
  /// One leaf at depth 0; nothing for an empty mesh.
  [[nodiscard]] bool visit(StructureVisitor& visitor) const override;
  void archive(Archive& archive) override;
  [[nodiscard]] std::size_t bytes() const noexcept override { return arena_.bytes(); }

  [[nodiscard]] std::size_t triangles() const noexcept { return triangles_; }
  [[nodiscard]] const std::string& leaf() const noexcept { return leaf_; }
  /// The mesh's vertices, which leaf blocks of indices name.
  [[nodiscard]] const Vec3f* vertices() const noexcept { return vertices_; }
  /// The leaf's blocks, of the form that leaf() names.
  [[nodiscard]] const std::byte* base() const noexcept { return arena_.data(); }
  [[nodiscard]] unsigned block_count() const noexcept { return block_count_; }

 private:
  Arena arena_;
  std::size_t triangles_ = 0;
  unsigned block_count_ = 0, block_width_ = 1;
  Bounds3f bounds_;
  const Vec3f* vertices_ = nullptr;
  std::string leaf_;
};

using Structures = TypeList<BruteForce>;

}  // namespace arboretum::brute_force
