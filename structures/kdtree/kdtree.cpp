#include "structures/kdtree/kdtree.h"

#include <algorithm>
#include <cmath>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/timer.h"
#include "intersectors/blocks.h"
#include "structures/archive.h"
#include "structures/box_pads.h"
#include "structures/interval_rays.h"
#include "structures/kdtree/builders.h"
#include "structures/kdtree/emit.h"
#include "structures/leaves/block_padding.h"
#include "structures/leaves/leaf_names.h"
#include "structures/parameter_limits.h"

namespace arboretum::kdtree {
namespace {

constexpr unsigned kDeepest = 63;       ///< the largest max_depth
constexpr std::size_t kReferences = 8;  ///< references at most, times the triangles
constexpr std::size_t kMostTriangles = (std::size_t{1} << 28) - 1;

[[nodiscard]] unsigned depth_limit(const BuilderParameters& p, std::size_t n) {
  return p.max_depth != 0 ? p.max_depth : std::min(kDeepest, unsigned(8.0 + 1.3 * std::log2(double(n) + 1.0)));
}

}  // namespace

const StructureInfo& KdTree::static_info() {
  static const StructureInfo info = [] {
    StructureInfo i;
    i.name = kName;
    i.summary = "kd-tree: axis-aligned planes, triangles clipped to their cells, 8-byte nodes";
    i.builders = {"binned_sah", "sweep_sah"};
    i.leaves = all_leaf_names();
    i.no_streams = kNoStreamsOfIntervals;
    return i;
  }();
  return info;
}

void KdTree::build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) {
  require_triangles(kName, mesh.size(), kMostTriangles);
  const Builder builder = settings.builder == "binned_sah"  ? &build_binned
                          : settings.builder == "sweep_sah" ? &build_sweep
                                                            : nullptr;
  if (!builder) throw UserError("kdtree has no builder '" + settings.builder + "'");
  static_cast<void>(require_leaf_form(kName, settings.leaf));
  with_block(settings.leaf, [&]<class Block>(std::type_identity<Block>) {
    leaf_ = settings.leaf, vertices_ = mesh.vertices.data();
    const Bounds3f bounds = mesh.size() == 0 ? Bounds3f{{0, 0, 0}, {0, 0, 0}} : mesh.bounds();
    const BoxPads pads(mesh, bounds);
    bounds_ = pads.widened(bounds), max_coordinate_ = pads.common();
    Part tree;
    if (mesh.size() == 0) {
      tree.nodes.push_back({0.0f, 3, 0, 0});
    } else {
      const CostModel model(settings.parameters, unsigned(Block::kWidth));
      const Limits limits{depth_limit(settings.parameters, mesh.size()), kReferences * mesh.size()};
      builder(mesh, pads, settings.parameters, model, limits, bounds_, tree, report);
    }
    const double start = wall_seconds();
    arena_ = Arena();
    Layout layout = lay_out(tree, unsigned(Block::kWidth), sizeof(Block));
    arena_ = std::move(layout.arena), root_ = layout.root, depth_ = layout.depth;
    tbb::parallel_for(std::size_t{0}, layout.leaves.size(), [&](std::size_t i) {
      const LeafPlan& leaf = layout.leaves[i];
      auto* blocks = reinterpret_cast<Block*>(arena_.data() + leaf.offset);
      fill_blocks(blocks, mesh, {leaf.ids, leaf.count});
      clear_padding(blocks, (leaf.count + unsigned(Block::kWidth) - 1) / unsigned(Block::kWidth));
    });
    report.phases.emplace_back("leaves", wall_seconds() - start);
  });
}

bool KdTree::visit(StructureVisitor& visitor) const {
  struct Entry {
    Node node;
    Bounds3f cell;
    unsigned depth;
  };
  with_block(leaf_, [&]<class Block>(std::type_identity<Block>) {
    std::vector<Entry> stack{{root_, bounds_, 0}};
    std::vector<std::uint32_t> primitives;
    while (!stack.empty()) {
      const auto [node, cell, depth] = stack.back();
      stack.pop_back();
      if (node.is_leaf()) {
        primitives.clear();
        append_primitives(reinterpret_cast<const Block*>(base() + node.offset()), node.blocks(), primitives);
        visitor.leaf({cell, primitives, depth, node.blocks(), unsigned(Block::kWidth),
                      sizeof(Node) + node.blocks() * sizeof(Block)});
        continue;
      }
      Bounds3f child[2] = {cell, cell};
      child[0].upper[std::size_t(node.axis())] = child[1].lower[std::size_t(node.axis())] = node.split;
      visitor.node({cell, child, depth, sizeof(Node)});
      const auto* pair = reinterpret_cast<const Node*>(base() + node.offset());
      stack.push_back({pair[1], child[1], depth + 1});
      stack.push_back({pair[0], child[0], depth + 1});
    }
  });
  return true;
}

void KdTree::archive(Archive& archive) {
  archive.expect(sizeof(Node));
  archive(leaf_, arena_, root_, bounds_, depth_, max_coordinate_);
  vertices_ = archive.mesh().vertices.data();
}

}  // namespace arboretum::kdtree
