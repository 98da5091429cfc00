#include "structures/octree/octree.h"

#include <bit>
#include <vector>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/timer.h"
#include "structures/archive.h"
#include "structures/leaves/leaf_names.h"
#include "structures/octree/octree_builder.h"
#include "structures/parameter_limits.h"

namespace arboretum::octree {

const StructureInfo& Octree::static_info() {
  static const StructureInfo info = [] {
    StructureInfo i;
    i.name = kName;
    i.summary = "sparse octree, children in the order of the ray's octant";
    i.builders = {"octants"};
    i.leaves = all_leaf_names();
    i.no_streams =
        "not built: a stream reads the children's boxes from the node; here they come from the node's place in the "
        "cube, which a stream's stack (a node and a mask of its rays) does not hold";
    return i;
  }();
  return info;
}

void Octree::build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) {
  const BuilderParameters& p = settings.parameters;
  require_within("octree: max_depth", p.max_depth, {0, kMostLevels});
  require_triangles(kName, mesh.size());
  const LeafForm& form = require_leaf_form(kName, settings.leaf);
  Tree tree;
  if (mesh.size() == 0) {  // an empty leaf
    tree.nodes.push_back({0, 0});
    tree.lists.begin.assign(2, 0);
  } else {
    build_tree(mesh, p, form.width, tree, report);
  }
  const double start = wall_seconds();
  MeteredVector<LeafCode> codes(tree.lists.size());
  for (LeafCode& c : codes) c = kEmptyLeaf;
  leaves_.fill(mesh, tree.lists, settings.leaf, kName, true, codes.data());
  nodes_ = std::move(tree.nodes);
  for (Node& n : nodes_)
    if (n.mask == 0) n.first = codes[n.first];
  cube_ = tree.cube, max_coordinate_ = tree.max_coordinate;
  report.phases.emplace_back("leaves", wall_seconds() - start);
}

void Octree::archive(Archive& archive) {
  archive.expect(sizeof(Node));
  archive(nodes_, cube_, max_coordinate_);
  leaves_.archive(archive);
}

bool Octree::visit(StructureVisitor& visitor) const {
  if (nodes_.size() == 1 && nodes_[0].first == kEmptyLeaf && nodes_[0].mask == 0) return true;
  with_block(leaves_.leaf(), [&]<class Block>(std::type_identity<Block>) {
    const auto* blocks = reinterpret_cast<const Block*>(leaves_.blocks());
    std::vector<bool> counted(leaves_.bytes() / sizeof(Block) + 1);  // shared blocks count once
    std::vector<std::uint32_t> primitives;
    const auto show = [&](const auto& self, const Node& node, unsigned level,
                          const std::array<std::uint32_t, 3>& at) -> void {
      const Bounds3f box = cube_.box(level, at);
      if (node.mask == 0) {
        const LongLeaf range = leaves_.range(node.first);
        primitives.clear();
        append_primitives(blocks + range.first, range.blocks, primitives);
        visitor.leaf({box, primitives, level, range.blocks, unsigned(Block::kWidth),
                      sizeof(Node) + (counted[range.first] ? 0 : range.blocks * sizeof(Block))});
        counted[range.first] = true;
        return;
      }
      std::array<std::uint32_t, 3> places[8];
      Bounds3f boxes[8];
      unsigned count = 0;
      for (std::uint32_t rest = node.mask; rest; rest &= rest - 1) {
        const auto c = std::uint32_t(std::countr_zero(rest));
        places[count] = {2 * at[0] + (c & 1), 2 * at[1] + (c >> 1 & 1), 2 * at[2] + (c >> 2)};
        boxes[count] = cube_.box(level + 1, places[count]), ++count;
      }
      visitor.node({box, {boxes, count}, level, sizeof(Node)});
      for (unsigned k = 0; k < count; ++k) self(self, nodes_[node.first + k], level + 1, places[k]);
    };
    show(show, nodes_[0], 0, {0, 0, 0});
  });
  return true;
}

}  // namespace arboretum::octree
