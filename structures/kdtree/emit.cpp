#include "structures/kdtree/emit.h"

#include <array>
#include <cstring>

#include "core/error.h"

namespace arboretum::kdtree {
namespace {

/// A node of the built tree, wherever it stands: in `part`, as its root when that is a plane, else at `index`.
struct Place {
  const Part* part;
  std::uint32_t index;

  [[nodiscard]] const BuildNode* own() const noexcept { return part->axis < 0 ? &part->nodes[index] : nullptr; }
  [[nodiscard]] bool is_leaf() const noexcept { return own() && own()->axis == 3; }
  [[nodiscard]] int axis() const noexcept { return own() ? int(own()->axis) : part->axis; }
  [[nodiscard]] float plane() const noexcept { return own() ? own()->plane : part->plane; }
  [[nodiscard]] Place child(std::uint32_t i) const noexcept {
    return own() ? Place{part, own()->first + i} : Place{part->child[i].get(), 0};
  }
};

/// How leaf blocks stand in the arena: a leaf begins on a multiple of `align`.
struct Blocks {
  unsigned width;
  std::size_t bytes, align = bytes % 64 == 0 ? 64 : 32;

  [[nodiscard]] std::uint32_t of(const BuildNode& leaf) const noexcept { return (leaf.count + width - 1) / width; }
  /// What so many blocks of a leaf take, the gap behind them included.
  [[nodiscard]] std::size_t room(std::uint32_t blocks) const noexcept {
    return (blocks * bytes + align - 1) / align * align;
  }
};

void count(const Place& node, std::size_t& pairs, std::size_t& leaves, std::size_t& bytes, const Blocks& blocks) {
  if (node.is_leaf()) {
    ++leaves, bytes += blocks.room(blocks.of(*node.own()));
    return;
  }
  ++pairs;
  count(node.child(0), pairs, leaves, bytes, blocks), count(node.child(1), pairs, leaves, bytes, blocks);
}

/// Places pairs in groups of up to four, a cache line: a pair, its children's pairs, then theirs, breadth first; then
/// the groups below, depth first. A ray that goes down meets a new line every second level or later.
class Writer {
 public:
  Writer(std::byte* base, std::size_t next_leaf, const Blocks& blocks, MeteredVector<LeafPlan>& leaves)
      : base_(base), next_leaf_(next_leaf), blocks_(blocks), leaves_(leaves) {}

  Node node(const Place& place, std::size_t pair_offset) {
    if (!place.is_leaf()) return Node::inner(place.plane(), place.axis(), pair_offset);
    const BuildNode& leaf = *place.own();
    const std::uint32_t blocks = blocks_.of(leaf);
    const std::size_t at = next_leaf_, used = at + blocks * blocks_.bytes;
    next_leaf_ += blocks_.room(blocks);
    if (blocks != 0) leaves_.push_back({at, place.part->ids.data() + leaf.first, leaf.count});
    if (used != next_leaf_) std::memset(base_ + used, 0, next_leaf_ - used);
    return Node::leaf(blocks, at);
  }

  /// Writes all that is below `top`, an inner node; returns where its children are.
  std::size_t below(const Place& top, unsigned depth) {
    constexpr unsigned kGroup = 4;
    struct Pair {
      Place parent;
      unsigned depth;
    };
    std::array<Pair, 3 * kGroup> queue;
    unsigned taken = 0, size = 0;
    queue[size++] = {top, depth};
    const std::size_t first = next_pair_;
    const auto offset_of = [&](unsigned i) { return first + i * 2 * sizeof(Node); };
    // The group: queue entries that get a place in it. The others wait until the group is complete.
    for (; taken < size && taken < kGroup; ++taken) {
      for (std::uint32_t i = 0; i < 2; ++i) {
        const Place child = queue[taken].parent.child(i);
        if (!child.is_leaf()) queue[size++] = {child, queue[taken].depth + 1};
      }
    }
    next_pair_ += taken * 2 * sizeof(Node);
    unsigned next = 1;
    for (unsigned p = 0; p < taken; ++p) {
      for (std::uint32_t i = 0; i < 2; ++i) {
        const Place child = queue[p].parent.child(i);
        std::size_t at = 0;
        if (!child.is_leaf()) {
          at = next < taken ? offset_of(next) : below(child, queue[p].depth + 1);
          ++next;
        } else {
          depth_ = std::max(depth_, queue[p].depth + 1);
        }
        new (base_ + offset_of(p) + i * sizeof(Node)) Node(node(child, at));
      }
    }
    return first;
  }

  void start(std::size_t next_pair) { next_pair_ = next_pair; }
  [[nodiscard]] unsigned depth() const noexcept { return depth_; }

 private:
  std::byte* base_;
  std::size_t next_pair_ = 0, next_leaf_;
  const Blocks blocks_;
  MeteredVector<LeafPlan>& leaves_;
  unsigned depth_ = 0;
};

}  // namespace

Layout lay_out(const Part& tree, unsigned width, std::size_t block_bytes) {
  const Place root{&tree, 0};
  const Blocks blocks{width, block_bytes};
  std::size_t pairs = 0, leaves = 0, leaf_bytes = 0;
  count(root, pairs, leaves, leaf_bytes, blocks);
  // The root stands behind the pairs: the tree keeps a copy of it at hand, its bytes are the arena's.
  const std::size_t used = (pairs * 2 + 1) * sizeof(Node), node_bytes = (used + 63) / 64 * 64;
  const std::size_t bytes = node_bytes + leaf_bytes;
  if (bytes > Node::kMostBytes) {
    throw UserError("kdtree would take " + std::to_string(bytes >> 20) +
                    " MiB; its links reach 16 GiB: use leaves of indices or a smaller mesh");
  }
  Layout out;
  out.leaves.reserve(leaves);
  out.arena = Arena(bytes);
  std::memset(out.arena.data() + used, 0, node_bytes - used);
  Writer writer(out.arena.data(), node_bytes, blocks, out.leaves);
  out.root = writer.node(root, root.is_leaf() ? 0 : writer.below(root, 0));
  new (out.arena.data() + pairs * 2 * sizeof(Node)) Node(out.root);
  out.depth = writer.depth();
  return out;
}

}  // namespace arboretum::kdtree
