// How a wide BVH is made from a binary tree, whatever the format of its nodes.
#pragma once

#include <algorithm>
#include <cstring>
#include <limits>
#include <span>
#include <utility>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/timer.h"
#include "structures/archive.h"
#include "structures/box_pads.h"
#include "structures/builders/box4.h"
#include "structures/builders/builders.h"
#include "structures/builders/collapse.h"
#include "structures/bvh/bvh.h"
#include "structures/bvh/wide_refit.h"
#include "structures/leaves/leaf_blocks.h"
#include "structures/leaves/leaf_names.h"
#include "structures/parameter_limits.h"

namespace arboretum::bvh {

/// Bytes that a node or leaf takes in the arena.
template <class Format>
[[nodiscard]] constexpr std::size_t round_up(std::size_t bytes) noexcept {
  static_assert(Format::kGranule % alignof(typename Format::Node) == 0 && Format::kGranule % 32 == 0);
  return (bytes + Format::kGranule - 1) / Format::kGranule * Format::kGranule;
}

/// A node for Format::write(). Of the bytes that it leaves, all within the last 32, every one is 0.
template <class Format>
[[nodiscard]] typename Format::Node* new_node(std::byte* at) noexcept {
  auto* node = new (at) typename Format::Node;
  constexpr std::size_t kBytes = round_up<Format>(sizeof(typename Format::Node));
  std::memset(at + kBytes - 32, 0, 32);
  return node;
}

/// Writes the wide tree into the arena: a node, then its leaves, then its inner children's subtrees. Leaves that are
/// filled already stand before all nodes, in the order of the tree.
template <class Format>
class Emitter {
 public:
  using Node = typename Format::Node;

  /// `split`: boxes may hold parts of triangles.
  Emitter(const TriangleMesh& mesh, const LeafForm& form, const BoxPads& pads, const WideTree& tree, bool split,
          std::byte* base)
      : mesh_(mesh), boxes_(mesh), form_(form), pads_(pads), tree_(tree), base_(base) {
    if (split && pads.any()) largest_.assign(tree.nodes.size(), 0.0f), find_largest(tree.nodes[0]);
  }

  /// Returns the depth of the deepest leaf below.
  unsigned subtree(const WideNode& from, std::size_t offset) const {
    auto* node = new_node<Format>(base_ + offset);
    std::size_t next = offset + round_up<Format>(sizeof(Node));
    const std::span<const WideNode> children = tree_.children(from);
    const auto count = unsigned(children.size());
    std::size_t child_offset[kMaxBranching];
    for (const bool leaves : {true, false}) {
      for (unsigned i = 0; i < count; ++i) {
        if (children[i].is_leaf() == leaves) child_offset[i] = place(children[i], next);
      }
    }
    Bounds3f boxes[kMaxBranching];
    NodeReference references[kMaxBranching] = {};
    for (unsigned i = 0; i < count; ++i) {
      boxes[i] = widened(children[i]);
      references[i] = reference(children[i], child_offset[i]);
    }
    Format::write(*node, boxes, references, count);
    unsigned depth[kMaxBranching] = {};
    const auto descend = [&](unsigned i) {
      if (children[i].is_leaf()) {
        leaf(children[i], child_offset[i]);
      } else {
        depth[i] = subtree(children[i], child_offset[i]);
      }
    };
    if (from.is_large()) {
      tbb::parallel_for(0u, count, descend);
    } else {
      for (unsigned i = 0; i < count; ++i) descend(i);
    }
    return 1 + *std::max_element(depth, depth + count);
  }

  /// Fills a leaf's blocks, where they are not yet.
  void leaf(const WideNode& from, std::size_t offset) const {
    if (tree_.in_blocks) return;
    boxes_.prefetch([&](std::size_t i) { return tree_.primitives[i]; }, from.first(), from.first() + from.references(),
                    tree_.primitives.size() - 1);
    LeafPrimitives room;
    form_.fill(base_ + offset, mesh_, tree_.leaf_primitives(from, room));
    const std::size_t used = from.blocks() * form_.bytes;
    std::memset(base_ + offset + used, 0, bytes(from) - used);
  }

  [[nodiscard]] static NodeReference reference(const WideNode& node, std::size_t offset) noexcept {
    return NodeReference(offset) | (node.is_leaf() ? kLeafBit | NodeReference(node.blocks() - 1) : 0u);
  }

  /// Where a node lies; `next`, where the next one may, goes on behind it. A leaf that is filled has its place.
  [[nodiscard]] std::size_t place(const WideNode& node, std::size_t& next) const noexcept {
    if (node.is_leaf() && tree_.in_blocks) return node.first() / form_.width * form_.bytes;
    return std::exchange(next, next + bytes(node));
  }

 private:
  [[nodiscard]] std::size_t index_of(const WideNode& node) const { return std::size_t(&node - &tree_.nodes[0]); }
  float find_largest(const WideNode& node) {
    float& largest = largest_[index_of(node)];
    if (node.is_leaf()) {
      LeafPrimitives room;
      largest = largest_coordinate(mesh_, tree_.leaf_primitives(node, room));
    } else {
      for (const WideNode& child : tree_.children(node)) largest = std::max(largest, find_largest(child));
    }
    return largest;
  }
  [[nodiscard]] Bounds3f widened(const WideNode& node) const {
    if (largest_.empty()) return pads_.widened(node.box);
    return BoxPads::widened(node.box, pads_.pad(largest_[index_of(node)]));
  }
  /// Of a node with all below, or of a leaf.
  [[nodiscard]] std::size_t bytes(const WideNode& node) const noexcept {
    return node.is_leaf() ? round_up<Format>(node.blocks() * form_.bytes) : node.granules() * Format::kGranule;
  }

  const TriangleMesh& mesh_;
  const TriangleBoxes boxes_;
  const LeafForm& form_;
  const BoxPads& pads_;
  const WideTree& tree_;
  /// The largest |coordinate| of the triangles below each node, where boxes do not tell it.
  MeteredVector<float> largest_;
  std::byte* base_;
};

template <class Format>
const StructureInfo& WideBvh<Format>::static_info() {
  static const StructureInfo info = [] {
    StructureInfo i;
    i.name = kName;
    i.summary = Format::kSummary;
    i.builders = binary_builder_names();
    i.leaves = all_leaf_names();
    i.can_refit = true;
    return i;
  }();
  return info;
}

template <class Format>
void WideBvh<Format>::build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) {
  constexpr std::uint64_t kReach = std::numeric_limits<NodeReference>::max();
  const BuilderParameters& p = settings.parameters;
  require_triangles(kName, mesh.size());
  const LeafForm& form = require_leaf_form(kName, settings.leaf);

  const CollapseSettings how{.branching = unsigned(kBranching),
                             .block_width = form.width,
                             .max_leaf_blocks = p.max_leaf_blocks,
                             .traversal_cost = p.traversal_cost,
                             .intersection_cost = p.intersection_cost,
                             .optimal = p.collapse == "optimal",
                             .node_bytes = sizeof(typename Format::Node),
                             .block_bytes = form.bytes,
                             .granule = Format::kGranule};
  BinaryTree tree;
  LeafBlocks blocks(form, round_up<Format>(sizeof(typename Format::Node)));
  // Indices are filled without a look at vertices, so nothing is gained, and more held beside their small blocks.
  const bool may_fill =
      !form.indices && form.bytes % Format::kGranule == 0 && mesh.size() / form.width * form.bytes <= kReach;
  build_binary_tree(
      mesh, settings, form.width, tree, report,
      {how.branching, [&](const BinaryTree& t) { return sah_cost(t, how); }, may_fill ? &blocks : nullptr});

  const bool split = tree.duplicates;
  double start = wall_seconds();
  const WideTree wide = collapse(std::move(tree), how);
  report.phases.emplace_back("collapse", wall_seconds() - start);

  start = wall_seconds();
  leaf_ = settings.leaf;
  if (mesh.size() == 0) {  // a node without children: every ray misses
    arena_ = Arena(round_up<Format>(sizeof(typename Format::Node)));
    Format::write(*new_node<Format>(arena_.data()), nullptr, nullptr, 0);
    root_ = 0, stack_entries_ = 2 * kBranching;
    set_scene(mesh, {}, 0.0f);
    return;
  }
  const WideNode& root = wide.nodes[0];
  const std::size_t nodes_begin = blocks.bytes();
  const std::uint64_t node_bytes = wide.granules * Format::kGranule, bytes = nodes_begin + node_bytes;
  if (bytes > kReach) {
    throw UserError(std::string(kName) + " with " + settings.leaf + " would take " + std::to_string(bytes >> 20) +
                    " MiB; its 32-bit references reach 4 GiB: use wider leaf blocks or a smaller mesh");
  }
  arena_ = {};
  arena_ = wide.in_blocks ? blocks.take(node_bytes) : Arena(node_bytes);
  const BoxPads pads(mesh, root.box);
  const Emitter<Format> emitter(mesh, form, pads, wide, split, arena_.data());
  std::size_t next = nodes_begin;
  const std::size_t at = emitter.place(root, next);
  root_ = emitter.reference(root, at);
  unsigned depth = 0;
  if (is_leaf(root_)) {
    emitter.leaf(root, at);
  } else {
    depth = emitter.subtree(root, at);
  }
  stack_entries_ = std::size_t(depth) * (kBranching - 1) + kBranching + 1;
  set_scene(mesh, pads.widened(root.box), pads.common());
  report.phases.emplace_back("leaves", wall_seconds() - start);
}

template <class Format>
bool WideBvh<Format>::visit(StructureVisitor& visitor) const {
  struct Entry {
    NodeReference reference;
    Bounds3f bounds;
    unsigned depth;
  };
  const LeafForm* form = find_leaf_form(leaf_);
  std::vector<Entry> stack{{root_, bounds_, 0}};
  std::vector<std::uint32_t> primitives;
  while (!stack.empty()) {
    const Entry e = stack.back();
    stack.pop_back();
    const std::byte* at = base() + offset_of(e.reference);
    if (bvh::is_leaf(e.reference)) {
      const unsigned blocks = block_count(e.reference);
      primitives.clear();
      form->append(at, blocks, primitives);
      visitor.leaf({e.bounds, primitives, e.depth, blocks, form->width, round_up<Format>(blocks * form->bytes)});
      continue;
    }
    Bounds3f boxes[kMaxBranching];
    NodeReference references[kMaxBranching];
    const unsigned count = Format::read(*reinterpret_cast<const typename Format::Node*>(at), boxes, references);
    visitor.node({e.bounds, {boxes, count}, e.depth, round_up<Format>(sizeof(typename Format::Node))});
    for (unsigned i = count; i-- > 0;) stack.push_back({references[i], boxes[i], e.depth + 1});
  }
  return true;
}

template <class Format>
void WideBvh<Format>::archive(Archive& archive) {
  archive.expect(sizeof(typename Format::Node));
  archive(leaf_, arena_, root_, stack_entries_, max_coordinate_, bounds_);
  vertices_ = archive.mesh().vertices.data(), triangles_ = archive.mesh().size();
}

}  // namespace arboretum::bvh
