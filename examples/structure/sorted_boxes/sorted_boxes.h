// sorted_boxes: no hierarchy. The triangles stand in leaf blocks, each block has a box, and a ray tests all boxes,
// eight at a time, then visits the blocks whose boxes it meets from near to far. O(n) a ray; an example of how small a
// structure can be.
//
// Memory: groups of eight boxes (192 bytes each, the layout that box tests read), then as many blocks as there are
// boxes.
#pragma once

// Standard headers that the kernels need stand here: what a kernel header includes is compiled for its instruction set.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "core/arena.h"
#include "core/type_list.h"
#include "structures/accel.h"

namespace arboretum::sorted_boxes {

/// planes[2 * axis + side][box], side 0 lower, 1 upper. A slot without a box has lower = +inf, upper = -inf: no ray
/// enters it.
struct alignas(64) BoxGroup {
  static constexpr int kWidth = 8;
  float planes[6][kWidth];
};

/// The builder that is its own: blocks of triangles that follow each other in the mesh.
inline constexpr std::string_view kMeshOrder = "mesh_order";

/// Builder parameters that it has beside BuilderParameters; sorted_boxes_parameters.h says what they may be.
struct Parameters {
  unsigned run_length = 16;  ///< mesh_order: triangles in a block at most, where the leaf's blocks have room
};

class SortedBoxes final : public Accel {
 public:
  static constexpr std::string_view kName = "sorted_boxes";

  Parameters parameters;  ///< of the next build

  [[nodiscard]] static const StructureInfo& static_info();
  [[nodiscard]] const StructureInfo& info() const noexcept override { return static_info(); }
  void build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) override;
  /// One node that has every box as a child, and a leaf of one block for each; nothing for an empty mesh.
  [[nodiscard]] bool visit(StructureVisitor& visitor) const override;
  void archive(Archive& archive) override;
  [[nodiscard]] std::size_t bytes() const noexcept override { return arena_.bytes(); }

  [[nodiscard]] std::size_t groups() const noexcept { return (blocks_ + BoxGroup::kWidth - 1) / BoxGroup::kWidth; }
  [[nodiscard]] std::size_t blocks() const noexcept { return blocks_; }
  [[nodiscard]] const BoxGroup* boxes() const noexcept { return reinterpret_cast<const BoxGroup*>(arena_.data()); }
  /// The blocks, in the order of the boxes. `Block` must be the one that the structure was built with.
  template <class Block>
  [[nodiscard]] const Block* block_data() const noexcept {
    return reinterpret_cast<const Block*>(block_bytes());
  }
  /// The first of them.
  [[nodiscard]] const std::byte* block_bytes() const noexcept { return arena_.data() + groups() * sizeof(BoxGroup); }
  /// The mesh's vertices, which leaf blocks of indices name.
  [[nodiscard]] const Vec3f* vertices() const noexcept { return vertices_; }
  /// Largest |coordinate|: what padded box tests scale their pad with.
  [[nodiscard]] float max_coordinate() const noexcept { return max_coordinate_; }

 private:
  Arena arena_;
  std::size_t blocks_ = 0;
  std::string leaf_;
  Bounds3f bounds_;
  const Vec3f* vertices_ = nullptr;
  float max_coordinate_ = 0.0f;
};

using Structures = TypeList<SortedBoxes>;

}  // namespace arboretum::sorted_boxes
