#include "sorted_boxes.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

#include "core/coordinates.h"
#include "core/error.h"
#include "core/timer.h"
#include "intersectors/blocks.h"
#include "structures/archive.h"
#include "structures/builders/builders.h"
#include "structures/leaves/leaf_form.h"
#include "structures/leaves/leaf_names.h"
#include "structures/parameter_limits.h"

namespace arboretum::sorted_boxes {
namespace {

/// The references of one block: up to Block::kWidth triangles that the builder put into one leaf.
using References = std::span<const std::uint32_t>;

/// Cuts `rest` into what one block takes each, and puts that behind `blocks`.
void add_blocks(References rest, std::size_t most, std::vector<References>& blocks) {
  while (!rest.empty()) {
    const std::size_t count = std::min(most, rest.size());
    blocks.push_back(rest.first(count));
    rest = rest.subspan(count);
  }
}

/// Cuts the leaves of the tree, left to right, into what one block takes each.
std::vector<References> references_by_block(const BinaryTree& tree, std::size_t block_width) {
  std::vector<References> blocks;
  std::vector<std::uint32_t> stack{0};
  while (!stack.empty()) {
    const std::uint32_t index = stack.back();
    stack.pop_back();
    const BinaryNode& node = tree.nodes[index];
    if (!node.is_leaf()) {
      stack.insert(stack.end(), {node.left + 1, node.left});
      continue;
    }
    add_blocks({tree.primitives.data() + tree.first[index], node.count}, block_width, blocks);
  }
  return blocks;
}

Bounds3f bounds_of(const TriangleMesh& mesh, References references) {
  Bounds3f box;
  for (std::uint32_t primitive : references) box.extend(mesh.bounds(primitive));
  return box;
}

Bounds3f read_box(const BoxGroup& group, std::size_t i) {
  const auto& p = group.planes;
  return {{p[0][i], p[2][i], p[4][i]}, {p[1][i], p[3][i], p[5][i]}};
}

void write_box(BoxGroup& group, std::size_t i, const Bounds3f& box) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    group.planes[2 * axis][i] = box.lower[axis], group.planes[2 * axis + 1][i] = box.upper[axis];
}

}  // namespace

const StructureInfo& SortedBoxes::static_info() {
  static const StructureInfo info = [] {
    StructureInfo i;
    i.name = kName;
    i.summary = "a flat list of leaf blocks, each with a box: all boxes tested, hit ones visited from near to far";
    i.builders = binary_builder_names();
    i.builders.push_back(kMeshOrder);
    i.leaves = all_leaf_names();
    i.only_single_rays = "every ray tests every box: there is no node to share";
    i.flat = true;
    i.root_is_node = true;
    return i;
  }();
  return info;
}

void SortedBoxes::build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) {
  require_triangles(kName, mesh.size());
  const bool known = with_block(settings.leaf, [&]<class Block>(std::type_identity<Block>) {
    BinaryTree tree;
    std::vector<std::uint32_t> in_order;
    std::vector<References> list;
    if (settings.builder == kMeshOrder) {
      in_order.resize(mesh.size());
      std::iota(in_order.begin(), in_order.end(), 0u);
      add_blocks(in_order, std::min<std::size_t>(parameters.run_length, Block::kWidth), list);
    } else if (mesh.size() > 0) {
      build_binary_tree(mesh, settings, unsigned(Block::kWidth), tree, report);
      list = references_by_block(tree, Block::kWidth);
    }

    const double start = wall_seconds();
    blocks_ = list.size();
    arena_ = Arena(groups() * sizeof(BoxGroup) + blocks_ * sizeof(Block));
    auto* group = reinterpret_cast<BoxGroup*>(arena_.data());
    auto* block = reinterpret_cast<Block*>(arena_.data() + groups() * sizeof(BoxGroup));
    for (std::size_t i = 0; i < groups() * BoxGroup::kWidth; ++i) {
      const bool exists = i < blocks_;
      write_box(group[i / BoxGroup::kWidth], i % BoxGroup::kWidth, exists ? bounds_of(mesh, list[i]) : Bounds3f{});
      // As a leaf form fills it: bytes that no triangle is in are 0, so that saved files are the same each time.
      if (exists) find_leaf_form(settings.leaf)->fill(reinterpret_cast<std::byte*>(block + i), mesh, list[i]);
    }
    report.phases.emplace_back("blocks", wall_seconds() - start);
  });
  if (!known) throw UserError("sorted_boxes has no leaf " + settings.leaf);

  leaf_ = settings.leaf, bounds_ = mesh.bounds(), vertices_ = mesh.vertices.data(),
  max_coordinate_ = largest_coordinate(bounds_);
}

bool SortedBoxes::visit(StructureVisitor& visitor) const {
  if (blocks_ == 0) return true;
  std::vector<Bounds3f> boxes;
  for (std::size_t i = 0; i < blocks_; ++i)
    boxes.push_back(read_box(this->boxes()[i / BoxGroup::kWidth], i % BoxGroup::kWidth));
  visitor.node({.bounds = bounds_, .child_bounds = boxes, .depth = 0, .bytes = groups() * sizeof(BoxGroup)});
  return with_block(leaf_, [&]<class Block>(std::type_identity<Block>) {
    for (std::size_t i = 0; i < blocks_; ++i) {
      const Block& block = block_data<Block>()[i];
      visitor.leaf({.bounds = boxes[i],
                    .primitives = {block.id, std::size_t(triangles_in(block))},
                    .depth = 1,
                    .blocks = 1,
                    .block_width = unsigned(Block::kWidth),
                    .bytes = sizeof(Block)});
    }
  });
}

void SortedBoxes::archive(Archive& archive) {
  archive.expect(sizeof(BoxGroup));
  archive(leaf_, arena_, blocks_, bounds_, max_coordinate_);
  vertices_ = archive.mesh().vertices.data();
}

}  // namespace arboretum::sorted_boxes
