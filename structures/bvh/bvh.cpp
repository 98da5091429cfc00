#include "structures/bvh/bvh.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/timer.h"
#include "structures/builders/builders.h"
#include "structures/builders/collapse.h"
#include "structures/leaves/blocks.h"

namespace arboretum::bvh {
namespace {

constexpr std::uint32_t kParallel = 1u << 12;

[[nodiscard]] std::size_t round_up(std::size_t bytes) noexcept { return (bytes + 31) / 32 * 32; }

/// Every leaf block that this structure knows, by its key.
using Blocks = TypeList<EdgeBlock<1>, EdgeBlock<4>, EdgeBlock<8>, EdgeBlock<16>, VertexBlock<1>, VertexBlock<4>, VertexBlock<8>, VertexBlock<16>>;

/// Calls f with the block type of that key; false where there is none.
template <class F>
bool with_block(std::string_view leaf, F&& f) {
  bool found = false;
  for_each_type(Blocks{}, [&]<class Block>(std::type_identity<Block> block) {
    if (Block::kName == leaf) found = true, f(block);
  });
  return found;
}

/// Writes the wide tree into the arena: a node, then its leaves, then its inner children's subtrees.
template <int N, class Block>
class Emitter {
 public:
  Emitter(const TriangleMesh& mesh, const BinaryTree& tree, const Collapse& collapse, std::byte* base)
      : mesh_(mesh), tree_(tree), collapse_(collapse), base_(base) {}

  /// Returns the depth of the deepest leaf below.
  unsigned subtree(std::uint32_t index, std::size_t offset) const {
    auto* node = new (base_ + offset) Node<N>;
    std::size_t next = offset + round_up(sizeof(Node<N>));
    const Slots slots = collapse_.children(index);
    std::size_t child_offset[kMaxBranching];
    for (const bool leaves : {true, false}) {
      for (unsigned i = 0; i < slots.size; ++i) {
        if (collapse_.is_leaf(slots.node[i]) != leaves) continue;
        child_offset[i] = next;
        next += collapse_.bytes(slots.node[i]);
      }
    }
    for (int i = 0; i < N; ++i) {
      const bool exists = unsigned(i) < slots.size;
      Bounds3f box;  // empty
      if (exists) box = {tree_.nodes[slots.node[i]].lower, tree_.nodes[slots.node[i]].upper};
      for (int axis = 0; axis < 3; ++axis) node->planes[2 * axis][i] = box.lower[axis], node->planes[2 * axis + 1][i] = box.upper[axis];
      node->child[i] = exists ? reference(slots.node[i], child_offset[i]) : 0;
    }
    unsigned depth[kMaxBranching] = {};
    const auto descend = [&](unsigned i) {
      if (collapse_.is_leaf(slots.node[i])) {
        leaf(slots.node[i], child_offset[i]);
      } else {
        depth[i] = subtree(slots.node[i], child_offset[i]);
      }
    };
    if (tree_.nodes[index].count > kParallel) {
      tbb::parallel_for(0u, slots.size, descend);
    } else {
      for (unsigned i = 0; i < slots.size; ++i) descend(i);
    }
    return 1 + *std::max_element(depth, depth + slots.size);
  }

  void leaf(std::uint32_t index, std::size_t offset) const {
    auto* block = reinterpret_cast<Block*>(base_ + offset);
    const std::uint32_t* ids = tree_.primitives.data() + tree_.begin_of(index);
    for (std::uint32_t left = tree_.nodes[index].count; left > 0; ++block) {
      const auto count = std::min<std::uint32_t>(left, Block::kWidth);
      fill_block(*new (block) Block, int(count), [&](int i) { return mesh_.corners(ids[i]); }, [&](int i) { return ids[i]; });
      ids += count, left -= count;
    }
  }

  [[nodiscard]] NodeReference reference(std::uint32_t index, std::size_t offset) const {
    return NodeReference(offset) | (collapse_.is_leaf(index) ? kLeafBit | (collapse_.blocks(index) - 1) : 0u);
  }

 private:
  const TriangleMesh& mesh_;
  const BinaryTree& tree_;
  const Collapse& collapse_;
  std::byte* base_;
};

template <int N>
[[nodiscard]] Bounds3f child_box(const Node<N>& node, int i) {
  return {{node.planes[0][i], node.planes[2][i], node.planes[4][i]}, {node.planes[1][i], node.planes[3][i], node.planes[5][i]}};
}

}  // namespace

template <int N>
const StructureInfo& Bvh<N>::static_info() {
  static const StructureInfo info = [] {
    StructureInfo i;
    i.name = kName;
    i.summary = N == 2   ? "binary bounding volume hierarchy"
                : N == 4 ? "4-wide bounding volume hierarchy, child boxes as structure of arrays"
                : N == 8 ? "8-wide bounding volume hierarchy, child boxes as structure of arrays"
                         : "16-wide bounding volume hierarchy, child boxes as structure of arrays";
    i.builders = {"binned_sah"};
    for_each_type(Blocks{}, [&]<class Block>(std::type_identity<Block>) { i.leaves.push_back(Block::kName); });
    return i;
  }();
  return info;
}

template <int N>
void Bvh<N>::build(const TriangleMesh& mesh, const BuildSettings& settings, BuildReport& report) {
  const BuilderParameters& p = settings.parameters;
  if (p.max_leaf_blocks < 1 || p.max_leaf_blocks > kMaxLeafBlocks) {
    throw UserError("max_leaf_blocks: " + std::to_string(p.max_leaf_blocks) + " is not within 1 .. " + std::to_string(kMaxLeafBlocks));
  }
  if (p.bins < 4 || p.bins > 64) throw UserError("bins: " + std::to_string(p.bins) + " is not within 4 .. 64");
  if (p.collapse != "optimal" && p.collapse != "greedy") throw UserError("collapse: '" + p.collapse + "' is neither optimal nor greedy");
  if (mesh.size() >= (1u << 30)) throw UserError(std::string(kName) + " takes at most 2^30 - 1 triangles");

  const bool known = with_block(settings.leaf, [&]<class Block>(std::type_identity<Block>) {
    BinaryTree tree;
    binary_builder(settings.builder, settings.isa)(mesh, p, unsigned(Block::kWidth), tree, report);

    double start = wall_seconds();
    const Collapse collapse(tree, {unsigned(N), unsigned(Block::kWidth), p.max_leaf_blocks, p.traversal_cost, p.intersection_cost,
                                   p.collapse == "optimal", sizeof(Node<N>), sizeof(Block)});
    report.phases.emplace_back("collapse", wall_seconds() - start);

    start = wall_seconds();
    leaf_ = settings.leaf;
    if (mesh.size() == 0) {  // a node without children: every ray misses
      arena_ = Arena(round_up(sizeof(Node<N>)));
      auto* node = new (arena_.data()) Node<N>;
      for (int i = 0; i < 6 * N; ++i) node->planes[i / N][i % N] = (i / N) % 2 == 0 ? Bounds3f::kInfinity : -Bounds3f::kInfinity;
      std::fill(std::begin(node->child), std::end(node->child), 0u);
      root_ = 0, stack_entries_ = 2 * N, bounds_ = {}, max_coordinate_ = 0.0f;
      return;
    }
    const std::uint64_t bytes = collapse.bytes(0);
    if (bytes > std::numeric_limits<NodeReference>::max()) {
      throw UserError(std::string(kName) + " with " + settings.leaf + " would take " + std::to_string(bytes >> 20) +
                      " MiB; its 32-bit references reach 4 GiB: use wider leaf blocks or a smaller mesh");
    }
    arena_ = Arena(bytes);
    const Emitter<N, Block> emitter(mesh, tree, collapse, arena_.data());
    root_ = emitter.reference(0, 0);
    unsigned depth = 0;
    if (is_leaf(root_)) {
      emitter.leaf(0, 0);
    } else {
      depth = emitter.subtree(0, 0);
    }
    stack_entries_ = std::size_t(depth) * (N - 1) + N + 1;
    bounds_ = {tree.nodes[0].lower, tree.nodes[0].upper};
    max_coordinate_ = 0.0f;
    for (int axis = 0; axis < 3; ++axis) {
      max_coordinate_ = std::max({max_coordinate_, std::fabs(bounds_.lower[axis]), std::fabs(bounds_.upper[axis])});
    }
    report.phases.emplace_back("leaves", wall_seconds() - start);
  });
  if (!known) throw UserError(std::string(kName) + " has no leaf '" + settings.leaf + "'");
}

template <int N>
bool Bvh<N>::visit(StructureVisitor& visitor) const {
  struct Entry {
    NodeReference reference;
    Bounds3f bounds;
    unsigned depth;
  };
  with_block(leaf_, [&]<class Block>(std::type_identity<Block>) {
    std::vector<Entry> stack{{root_, bounds_, 0}};
    std::vector<Bounds3f> boxes;
    std::vector<std::uint32_t> primitives;
    while (!stack.empty()) {
      const Entry e = stack.back();
      stack.pop_back();
      const std::byte* at = base() + offset_of(e.reference);
      if (bvh::is_leaf(e.reference)) {
        const auto* block = reinterpret_cast<const Block*>(at);
        const unsigned blocks = block_count(e.reference);
        primitives.clear();
        for (unsigned b = 0; b < blocks; ++b) {
          for (std::uint32_t id : block[b].id)
            if (id != kNoPrimitive) primitives.push_back(id);
        }
        visitor.leaf({e.bounds, primitives, e.depth, blocks, unsigned(Block::kWidth), round_up(blocks * sizeof(Block))});
        continue;
      }
      const auto& node = *reinterpret_cast<const Node<N>*>(at);
      boxes.clear();
      for (int i = 0; i < N && node.planes[0][i] <= node.planes[1][i]; ++i) boxes.push_back(child_box(node, i));
      visitor.node({e.bounds, boxes, e.depth, round_up(sizeof(Node<N>))});
      for (std::size_t i = boxes.size(); i-- > 0;) stack.push_back({node.child[i], boxes[i], e.depth + 1});
    }
  });
  return true;
}

template class Bvh<2>;
template class Bvh<4>;
template class Bvh<8>;
template class Bvh<16>;

}  // namespace arboretum::bvh
