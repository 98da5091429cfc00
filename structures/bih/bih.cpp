#include "structures/bih/bih.h"

#include <algorithm>
#include <vector>

#include "core/error.h"
#include "core/timer.h"
#include "structures/archive.h"
#include "structures/box_pads.h"
#include "structures/builders/builders.h"
#include "structures/builders/collapse.h"
#include "structures/bvh/bvh.h"
#include "structures/interval_rays.h"
#include "structures/leaves/leaf_names.h"
#include "structures/parameter_limits.h"

namespace arboretum::bih {
namespace {

/// Turns a binary tree with boxes into nodes with planes.
class Converter {
 public:
  Converter(const TriangleMesh& mesh, const BinaryTree& tree, const BoxPads& pads, const Collapse& collapse,
            const CollapseSettings& costs, MeteredVector<Node>& nodes, LeafLists& lists)
      : mesh_(mesh), tree_(tree), pads_(pads), collapse_(collapse), costs_(costs), nodes_(nodes), lists_(lists),
        cost_(tree.node_count) {
    if (tree.duplicates && pads.any()) largest_.resize(tree.node_count), find_largest(0);
    price(0);
    nodes_.resize(1);
    place(0, 0, box_of(0), 0);
    lists_.begin.push_back(std::uint32_t(lists_.ids.size()));
  }
  [[nodiscard]] std::size_t pairs_deep() const noexcept { return deepest_; }
  /// The SAH cost of the nodes and leaves, times the root's area.
  [[nodiscard]] double sah_cost() const noexcept { return sah_cost_; }

 private:
  [[nodiscard]] Bounds3f box_of(std::uint32_t node) const {
    const Bounds3f box{tree_.nodes[node].lower, tree_.nodes[node].upper};
    return largest_.empty() ? pads_.widened(box) : BoxPads::widened(box, pads_.pad(largest_[node]));
  }
  float find_largest(std::uint32_t index) {
    const BinaryNode& node = tree_.nodes[index];
    if (!node.is_leaf()) return largest_[index] = std::max(find_largest(node.left), find_largest(node.left + 1));
    return largest_[index] = largest_coordinate(mesh_, {&tree_.primitives[tree_.begin_of(index)], node.count});
  }

  /// Expected cost below a node for a ray that meets its box.
  float price(std::uint32_t node) {
    if (collapse_.is_leaf(node)) return cost_[node] = costs_.intersection_cost * float(collapse_.blocks(node));
    const std::uint32_t left = tree_.nodes[node].left;
    const float whole = tree_.nodes[node].half_area();
    float below = 0;
    for (std::uint32_t child : {left, left + 1}) {
      const float cost = price(child);
      below += whole > 0 ? cost * tree_.nodes[child].half_area() / whole : cost;
    }
    return cost_[node] = costs_.traversal_cost + below;
  }

  /// Writes the subtree at `node` into `slot`. A ray comes there that has passed the planes above, which
  /// leave `region`.
  void place(std::uint32_t node, std::uint32_t slot, Bounds3f region, std::size_t pairs) {
    const Bounds3f box = box_of(node);
    const auto count_node = [&] { sah_cost_ += region.area() * double(costs_.traversal_cost); };
    for (unsigned clipped = 0;;) {  // bit k: axis k is done
      int best = -1;
      double best_cost = 0.999 * cost_[node];
      for (int axis = 0; axis < 3; ++axis) {
        const double area = region.area();
        if ((clipped >> axis & 1) != 0 || !(area > 0)) continue;
        const double cost = costs_.traversal_cost + clip(region, box, axis).area() / area * cost_[node];
        if (cost < best_cost) best = axis, best_cost = cost;
      }
      if (best < 0) break;
      clipped |= 1u << best;
      count_node();
      region = clip(region, box, best);
      const std::uint32_t child = take(1);
      nodes_[slot] = {{box.lower[std::size_t(best)], box.upper[std::size_t(best)]},
                      child << 3 | (Node::kClip + std::uint32_t(best))};
      slot = child;
    }
    if (collapse_.is_leaf(node)) {
      // the code comes later
      nodes_[slot] = {{std::bit_cast<float>(std::uint32_t(lists_.begin.size())), 0.0f}, Node::kLeaf};
      lists_.begin.push_back(std::uint32_t(lists_.ids.size()));
      LeafPrimitives room;
      const std::span<const std::uint32_t> ids =
          distinct({tree_.primitives.data() + tree_.begin_of(node), tree_.nodes[node].count}, room);
      lists_.ids.insert(lists_.ids.end(), ids.begin(), ids.end());
      sah_cost_ += region.area() * double(costs_.intersection_cost) * collapse_.blocks(node);
      return;
    }
    count_node();
    std::uint32_t left = tree_.nodes[node].left, right = left + 1;
    std::size_t axis = 0;
    bool swapped = false;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t a = 0; a < 3; ++a) {
      for (const bool swap : {false, true}) {
        const Bounds3f l = below(region, box_of(swap ? right : left).upper[a], a),
                       r = above(region, box_of(swap ? left : right).lower[a], a);
        const double cost = l.area() * cost_[swap ? right : left] + r.area() * cost_[swap ? left : right];
        if (cost < least) least = cost, axis = a, swapped = swap;
      }
    }
    if (swapped) std::swap(left, right);
    const float left_end = box_of(left).upper[axis], right_begin = box_of(right).lower[axis];
    const std::uint32_t first = take(2);
    nodes_[slot] = {{left_end, right_begin}, first << 3 | (Node::kPair + std::uint32_t(axis))};
    deepest_ = std::max(deepest_, pairs + 1);
    place(left, first, below(region, left_end, axis), pairs + 1);
    place(right, first + 1, above(region, right_begin, axis), pairs + 1);
  }

  static Bounds3f below(Bounds3f region, float end, std::size_t axis) {
    return region.upper[axis] = std::min(region.upper[axis], end), region;
  }
  static Bounds3f above(Bounds3f region, float begin, std::size_t axis) {
    return region.lower[axis] = std::max(region.lower[axis], begin), region;
  }
  static Bounds3f clip(const Bounds3f& region, const Bounds3f& box, int axis) {
    const auto a = std::size_t(axis);
    return below(above(region, box.lower[a], a), box.upper[a], a);
  }

  std::uint32_t take(std::uint32_t count) {
    const std::size_t first = nodes_.size();
    if (first + count >= (std::size_t(1) << 29))
      throw UserError("bih: more than 2^29 nodes: use wider leaf blocks or a smaller mesh");
    nodes_.resize(first + count);
    return std::uint32_t(first);
  }

  const TriangleMesh& mesh_;
  const BinaryTree& tree_;
  const BoxPads& pads_;
  const Collapse& collapse_;
  const CollapseSettings& costs_;
  MeteredVector<Node>& nodes_;
  LeafLists& lists_;
  MeteredVector<float> cost_;
  /// The largest |coordinate| of the triangles below each node, where boxes do not tell it.
  MeteredVector<float> largest_;
  std::size_t deepest_ = 0;
  double sah_cost_ = 0.0;
};

double sah_cost_of(const TriangleMesh& mesh, const BinaryTree& tree, const BoxPads& pads, const CollapseSettings& how) {
  MeteredVector<Node> nodes;
  LeafLists lists;
  return Converter(mesh, tree, pads, Collapse(tree, how), how, nodes, lists).sah_cost();
}

}  // namespace

const StructureInfo& Bih::static_info() {
  static const StructureInfo info = [] {
    StructureInfo i;
    i.name = kName;
    i.summary = "bounding interval hierarchy: two planes a node, between kd-tree and BVH";
    i.builders = binary_builder_names();
    i.leaves = all_leaf_names();
    i.no_streams = kNoStreamsOfIntervals;
    return i;
  }();
  return info;
}

void Bih::build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) {
  const BuilderParameters& p = settings.parameters;
  require_triangles(kName, mesh.size());
  static_cast<void>(require_leaf_form(kName, settings.leaf));
  LeafLists lists;
  nodes_.clear(), bounds_ = mesh.bounds(), stack_entries_ = 1, max_coordinate_ = 0.0f;
  if (mesh.size() == 0) {  // an empty leaf, behind an empty box
    nodes_.push_back({{0.0f, 0.0f}, Node::kLeaf});
    lists.begin.assign(2, 0);
  } else {
    with_block(settings.leaf, [&]<class Block>(std::type_identity<Block>) {
      const CollapseSettings how{.branching = 2,
                                 .block_width = unsigned(Block::kWidth),
                                 .max_leaf_blocks = p.max_leaf_blocks,
                                 .traversal_cost = p.traversal_cost,
                                 .intersection_cost = p.intersection_cost,
                                 .optimal = true,
                                 .node_bytes = 2 * sizeof(Node),
                                 .block_bytes = sizeof(Block)};
      BinaryTree tree;
      const BoxPads pads(mesh, bounds_);
      build_binary_tree(mesh, settings, unsigned(Block::kWidth), tree, report,
                        {2, [&](const BinaryTree& t) { return sah_cost_of(mesh, t, pads, how); }});
      const double start = wall_seconds();
      stack_entries_ = Converter(mesh, tree, pads, Collapse(tree, how), how, nodes_, lists).pairs_deep() + 1;
      bounds_ = pads.widened(bounds_), max_coordinate_ = pads.common();
      nodes_.shrink_to_fit();
      report.phases.emplace_back("planes", wall_seconds() - start);
    });
  }
  const double start = wall_seconds();
  MeteredVector<LeafCode> codes(lists.size());
  for (LeafCode& c : codes) c = kEmptyLeaf;
  leaves_.fill(mesh, lists, settings.leaf, kName, false, codes.data());
  for (Node& n : nodes_)
    if (n.kind() == Node::kLeaf) n.clip[0] = std::bit_cast<float>(codes[n.code()]);
  report.phases.emplace_back("leaves", wall_seconds() - start);
}

void Bih::archive(Archive& archive) {
  archive.expect(sizeof(Node));
  archive(nodes_, bounds_, max_coordinate_, stack_entries_);
  leaves_.archive(archive);
}

bool Bih::visit(StructureVisitor& visitor) const {
  if (bounds_.empty()) return true;
  struct Entry {
    std::uint32_t node;
    Bounds3f region;
    unsigned depth;
  };
  with_block(leaves_.leaf(), [&]<class Block>(std::type_identity<Block>) {
    const auto* blocks = reinterpret_cast<const Block*>(leaves_.blocks());
    std::vector<Entry> stack{{0, bounds_, 0}};
    std::vector<std::uint32_t> primitives;
    while (!stack.empty()) {
      const Entry e = stack.back();
      stack.pop_back();
      const Node& node = nodes_[e.node];
      if (node.kind() == Node::kLeaf) {
        const LongLeaf range = leaves_.range(node.code());
        primitives.clear();
        append_primitives(blocks + range.first, range.blocks, primitives);
        visitor.leaf({e.region, primitives, e.depth, range.blocks, unsigned(Block::kWidth),
                      sizeof(Node) + range.blocks * sizeof(Block)});
        continue;
      }
      const std::size_t axis = node.kind() & 3u;
      const bool pair = node.kind() < Node::kClip;
      Bounds3f regions[2] = {e.region, e.region};
      if (pair) {
        regions[0].upper[axis] = std::min(regions[0].upper[axis], node.clip[0]);
        regions[1].lower[axis] = std::max(regions[1].lower[axis], node.clip[1]);
      } else {
        regions[0].lower[axis] = std::max(regions[0].lower[axis], node.clip[0]);
        regions[0].upper[axis] = std::min(regions[0].upper[axis], node.clip[1]);
      }
      visitor.node({e.region, {regions, pair ? 2u : 1u}, e.depth, sizeof(Node)});
      for (unsigned i = pair ? 2 : 1; i-- > 0;) stack.push_back({node.first() + i, regions[i], e.depth + 1});
    }
  });
  return true;
}

}  // namespace arboretum::bih
