#include "structures/builders/collapse.h"

#include <algorithm>
#include <bit>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include <emmintrin.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#include "structures/builders/number_runs.h"
#include "structures/builders/one_task.h"

namespace arboretum {
namespace {
constexpr std::uint32_t kTooMany = 1000;  // references, more than a leaf holds

}  // namespace

std::span<const std::uint32_t> distinct(std::span<const std::uint32_t> references, LeafPrimitives& room) noexcept {
  const auto end = std::copy(references.begin(), references.end(), room.begin());
  std::sort(room.begin(), end);
  return {room.data(), std::size_t(std::unique(room.begin(), end) - room.begin())};
}

/// cost[k - 1]: least cost of the subtree in at most k slots of its parent; infinite above `slots`, and so is what
/// stands before it.
struct Collapse::Costs {
  alignas(16) float before[kMaxBranching];
  float cost[kMaxBranching];
  unsigned slots = 1;

  /// Prepares for `most` slots.
  void clear(unsigned most) noexcept {
    const __m128 none = _mm_set1_ps(std::numeric_limits<float>::infinity());
    unsigned i = 0;
    do {
      _mm_store_ps(before + kMaxBranching - 4 - i, none), _mm_store_ps(cost + i, none);
    } while ((i += 4) < most);
  }
};

/// least[k - 1]: the least sum of two subtrees' costs in exactly k slots, k up to `slots`; left[k - 1]: of these the
/// left one's, the fewest of equals. All k in lanes.
struct Collapse::Shares {
  alignas(16) float least[kMaxBranching];
  alignas(16) std::int32_t left[kMaxBranching];
  Shares(const Costs& a, const Costs& b, unsigned slots) noexcept {
    unsigned at = 0;
    do {
      __m128 best = _mm_set1_ps(std::numeric_limits<float>::infinity());
      __m128i share = _mm_set1_epi32(1);
      // These lanes' slots are at + 1 .. at + 4, and the right side needs one too
      const unsigned most_left = std::min(a.slots, at + 3);
      for (unsigned l = at + 1 > b.slots ? at + 1 - b.slots : 1; l <= most_left; ++l) {
        const __m128 sum = _mm_add_ps(_mm_set1_ps(a.cost[l - 1]), _mm_loadu_ps(b.before + kMaxBranching + at - l));
        const __m128i less = _mm_castps_si128(_mm_cmplt_ps(sum, best));
        best = _mm_min_ps(sum, best);
        share = _mm_or_si128(_mm_and_si128(less, _mm_set1_epi32(int(l))), _mm_andnot_si128(less, share));
      }
      _mm_store_ps(least + at, best);
      _mm_store_si128(reinterpret_cast<__m128i*>(left + at), share);
    } while ((at += 4) < slots);
  }
};

Collapse::Collapse(const BinaryTree& tree, const CollapseSettings& settings) : tree_(tree), settings_(settings) {
  plan_.resize(tree.node_count);
  if (tree.node_count == 0) return;
  if (settings_.optimal) {
    choice_.resize((tree.node_count / 2 + 1) * settings_.branching);
    Costs root;
    optimise(0, root);
  } else {
    choose_leaves(0);
  }
}

/// How many references the leaf made from this node would hold. Where a subtree's leaves may repeat primitives, so does
/// not the leaf.
unsigned Collapse::leaf_references(std::uint32_t index) const noexcept {
  const BinaryNode& node = tree_.nodes[index];
  const bool repeats = tree_.duplicates && !node.is_leaf() && node.count <= kMaxMergedReferences &&
                       blocks_for(node.count) <= 2 * settings_.max_leaf_blocks;
  if (!repeats) return std::min(node.count, kTooMany);
  LeafPrimitives room;
  return unsigned(distinct({tree_.primitives.data() + tree_.begin_of(index), node.count}, room).size());
}

void Collapse::optimise(std::uint32_t index, Costs& out) {
  const BinaryNode& node = tree_.nodes[index];
  const float area = node.half_area();
  const unsigned n = settings_.branching,
                 references = tree_.duplicates ? leaf_references(index) : std::min(node.count, kTooMany);
  const unsigned leaf_blocks = blocks_for(references);
  const float leaf_cost = area * (kLeafVisit + float(leaf_blocks)) * settings_.intersection_cost;
  out.clear(n);
  if (node.is_leaf()) {
    out.slots = 1, out.cost[0] = leaf_cost;
    plan_[index] = {std::uint16_t(references), 1, true};
    return;
  }
  Costs left, right;
  if (node.count > kOneTask) {
    tbb::parallel_invoke([&] { optimise(node.left, left); }, [&] { optimise(node.left + 1, right); });
  } else {
    optimise(node.left, left);
    optimise(node.left + 1, right);
  }
  std::uint8_t* choice = &choice_[choices_of(index)];
  const unsigned most = out.slots = std::min(n, left.slots + right.slots);
  const Shares shares(left, right, most);
  const float* split_cost = shares.least;
  unsigned cheapest = 2;
  for (unsigned k = 3; k <= most; ++k) {
    if (split_cost[k - 1] < split_cost[cheapest - 1]) cheapest = k;
  }
  const float inner_cost = area * settings_.traversal_cost + split_cost[cheapest - 1];
  const bool leaf =
      node.count <= kMaxMergedReferences && leaf_blocks <= settings_.max_leaf_blocks && leaf_cost <= inner_cost;
  plan_[index] = {std::uint16_t(references), std::uint16_t(cheapest), leaf};
  float cost = out.cost[0] = leaf ? leaf_cost : inner_cost;
  // A leaf in one slot may still be opened into several, where the parent has them to spare.
  unsigned used = 1;
  for (unsigned k = 2; k <= most; ++k) {
    if (split_cost[k - 1] < cost) cost = split_cost[k - 1], used = k;
    out.cost[k - 1] = cost;
    choice[k - 1] = std::uint8_t(unsigned(shares.left[k - 1] - 1) | (used - 1) << 4);
  }
}

void Collapse::choose_leaves(std::uint32_t index) {
  const BinaryNode& node = tree_.nodes[index];
  const unsigned references = leaf_references(index);
  const bool leaf = node.is_leaf() || blocks_for(references) <= 1;
  plan_[index] = {std::uint16_t(references), std::uint16_t(settings_.branching), leaf};
  if (leaf) return;
  if (node.count > kOneTask) {
    tbb::parallel_invoke([&] { choose_leaves(node.left); }, [&] { choose_leaves(node.left + 1); });
  } else {
    choose_leaves(node.left);
    choose_leaves(node.left + 1);
  }
}

void Collapse::expand(std::uint32_t index, std::uint32_t begin, unsigned slots, Slots& out) const noexcept {
  if (slots > 1) {
    const std::uint8_t* choice = &choice_[choices_of(index)];
    if (const unsigned used = (choice[slots - 1] >> 4) + 1u; used > 1) return expand_children(index, begin, used, out);
  }
  out.node[out.size] = index, out.begin[out.size++] = begin;
}

void Collapse::expand_children(std::uint32_t index, std::uint32_t begin, unsigned slots, Slots& out) const noexcept {
  const unsigned left_slots = (choice_[choices_of(index) + slots - 1] & 15u) + 1;
  const std::uint32_t left = tree_.nodes[index].left;
  expand(left, begin, left_slots, out);
  expand(left + 1, begin_after(left, begin), slots - left_slots, out);
}

Slots Collapse::children(std::uint32_t index, std::uint32_t begin) const noexcept {
  Slots out;
  if (settings_.optimal) {
    expand_children(index, begin, unsigned(plan_[index].slots), out);
    return out;
  }
  const auto put_pair = [&](std::uint32_t left, std::uint32_t from, unsigned at) {
    out.node[at] = left, out.begin[at] = from;
    out.node[out.size] = left + 1, out.begin[out.size++] = begin_after(left, from);
  };
  out.size = 1;
  put_pair(tree_.nodes[index].left, begin, 0);
  while (out.size < settings_.branching) {  // open the largest
    int largest = -1;
    float largest_area = -1.0f;
    for (unsigned i = 0; i < out.size; ++i) {
      if (is_leaf(out.node[i])) continue;
      if (const float area = tree_.nodes[out.node[i]].half_area(); area > largest_area)
        largest_area = area, largest = int(i);
    }
    if (largest < 0) break;
    put_pair(tree_.nodes[out.node[largest]].left, out.begin[largest], unsigned(largest));
  }
  return out;
}

/// Places in the array depend on scheduling, the tree does not.
class Collapse::Writer {
 public:
  Writer(const Collapse& collapse, ReservedArray<WideNode>& out)
      : collapse_(collapse), tree_(collapse.tree_), out_(out),
        shares_(std::size_t(tbb::this_task_arena::max_concurrency())) {
    // A run ends where fewer are left than siblings are asked for; and each place leaves one unfinished, the root's
    // task another.
    const std::size_t runs = tree_.node_count / (kRun - kMaxBranching) + 1 + shares_.size() + 1;
    out.reserve(1 + runs * kRun), out.hand_out(1);
  }

  /// Returns how many granules all take.
  std::uint64_t write() {
    Share share;
    const Below all = write(0, 0, 0, share);
    shares_.push_back(share);
    for (const Share& last : shares_)
      if (!last.is_new()) out_.hand_out(kRun - last.left());
    return all.granules;
  }

 private:
  using Share = NumberRuns::Share;
  static constexpr std::uint32_t kRun = 512;

  /// The first of `n` neighbouring nodes. A run counts when it is done.
  std::uint32_t take(unsigned n, Share& share) {
    return numbers_.take(n, share, [&] { out_.hand_out(share.is_new() ? 0 : kRun); });
  }

  struct Below {
    float cost;  ///< SAH cost for a ray that enters the subtree
    std::uint64_t granules;
  };

  /// Writes the subtree, whose references begin at `begin`.
  Below write(std::uint32_t index, std::uint32_t begin, std::uint32_t place, Share& share) {
    const BinaryNode& node = tree_.nodes[index];
    const CollapseSettings& settings = collapse_.settings_;
    const Bounds3f box{node.lower, node.upper};
    if (collapse_.is_leaf(index)) {
      const unsigned blocks = collapse_.blocks(index);
      out_[place] = WideNode::leaf(box, begin, node.count, blocks, tree_.duplicates && !node.is_leaf());
      return {(kLeafVisit + float(blocks)) * settings.intersection_cost,
              granules(tree_.in_blocks ? 0 : blocks * settings.block_bytes)};
    }
    const Slots slots = collapse_.children(index, begin);
    const std::uint32_t first = take(slots.size, share);
    Below below[kMaxBranching];
    const auto child = [&](unsigned i, Share& its) { below[i] = write(slots.node[i], slots.begin[i], first + i, its); };
    const bool large = node.count > kOneTask;
    if (large) {
      // A thread that waits here takes up other tasks, but none at the same time: its place's share is its own.
      tbb::parallel_for(0u, slots.size, [&](unsigned i) {
        child(i, shares_[std::size_t(tbb::this_task_arena::current_thread_index())]);
      });
    } else {
      for (unsigned i = 0; i < slots.size; ++i) child(i, share);
    }
    Below all{settings.traversal_cost, granules(settings.node_bytes)};
    const float area = node.half_area();
    for (unsigned i = 0; i < slots.size; ++i) {
      all.granules += below[i].granules;
      all.cost += below[i].cost * (area > 0.0f ? tree_.nodes[slots.node[i]].half_area() / area : 1.0f);
    }
    out_[place] = WideNode::inner(box, first, slots.size, large, all.granules);
    order(&out_[first], below, slots.size);
    return all;
  }

  /// Puts children that cost little, such as leaves, last, where any hit looks first; others of much the same cost,
  /// within a factor of eight, stay as the builder has them, next to each other in space.
  static void order(WideNode* children, const Below* below, unsigned size) noexcept {
    int cost[kMaxBranching];
    // round(log8(cost)): of at least 1, but for settings of one's own; the exponent as the bits have it
    for (unsigned i = 0; i < size; ++i)
      cost[i] = ((std::bit_cast<std::int32_t>(below[i].cost * 0x1.6a09e6p1f) >> 23) - 127) / 3;
    for (unsigned i = 1; i < size; ++i) {
      const WideNode moved = children[i];
      const int its = cost[i];
      unsigned to = i;
      for (; to > 0 && cost[to - 1] < its; --to) children[to] = children[to - 1], cost[to] = cost[to - 1];
      children[to] = moved, cost[to] = its;
    }
  }
  [[nodiscard]] std::uint64_t granules(std::uint64_t bytes) const noexcept {
    const std::uint64_t granule = collapse_.settings_.granule;
    return (bytes + granule - 1) / granule;
  }
  const Collapse& collapse_;
  const BinaryTree& tree_;
  ReservedArray<WideNode>& out_;
  std::vector<Share> shares_;
  NumberRuns numbers_{1, kRun};
};

std::uint64_t Collapse::write(ReservedArray<WideNode>& out) const {
  return tree_.node_count == 0 ? 0 : Writer(*this, out).write();
}

double Collapse::cost(std::uint32_t index) const {
  const BinaryNode& node = tree_.nodes[index];
  const double area = Bounds3f{node.lower, node.upper}.area();
  if (is_leaf(index)) return area * double(settings_.intersection_cost) * blocks(index);
  const Slots slots = children(index, 0);
  double below[kMaxBranching];
  const auto child = [&](unsigned i) { below[i] = cost(slots.node[i]); };
  if (node.count > kOneTask) {
    tbb::parallel_for(0u, slots.size, child);
  } else {
    for (unsigned i = 0; i < slots.size; ++i) child(i);
  }
  return std::accumulate(below, below + slots.size, area * double(settings_.traversal_cost));
}

double sah_cost(const BinaryTree& tree, const CollapseSettings& settings) {
  return tree.node_count == 0 ? 0.0 : Collapse(tree, settings).cost(0);
}

WideTree collapse(BinaryTree&& tree, const CollapseSettings& settings) {
  WideTree wide;
  const Collapse plan(tree, settings);
  tree.first.clear();
  wide.granules = plan.write(wide.nodes);
  wide.primitives = std::move(tree.primitives), wide.in_blocks = tree.in_blocks;
  tree.nodes.clear();
  return wide;
}

std::span<const std::uint32_t> WideTree::leaf_primitives(const WideNode& leaf, LeafPrimitives& room) const noexcept {
  const std::span<const std::uint32_t> references{primitives.data() + leaf.first(), leaf.references()};
  return leaf.repeats() ? distinct(references, room) : references;
}

}  // namespace arboretum
