#include "structures/builders/collapse.h"

#include <algorithm>
#include <limits>

#include <emmintrin.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

namespace arboretum {
namespace {
constexpr std::uint32_t kParallel = 1u << 12;
constexpr std::uint32_t kTooMany = 1000;  // references, more than a leaf holds
/// What a leaf costs beside its blocks, in blocks. SAH knows none of it; where boxes overlap (`generate: needles`) rays lose by trees that open every leaf.
constexpr float kLeafVisit = 0.25f;
}

/// cost[k - 1]: least cost of the subtree in at most k slots of its parent; infinite above `slots`, and so is what stands before it.
struct Collapse::Costs {
  Costs() noexcept {
    for (int i = 0; i < 2 * int(kMaxBranching); i += 4) _mm_store_ps(before + i, _mm_set1_ps(std::numeric_limits<float>::infinity()));
  }
  alignas(16) float before[kMaxBranching];
  float cost[kMaxBranching];
  unsigned slots = 1;
};

/// least[k - 1]: the least sum of two subtrees' costs in exactly k slots; left[k - 1]: of these the left one's, the fewest of equals. All k in lanes.
struct Collapse::Shares {
  alignas(16) float least[kMaxBranching];
  alignas(16) std::int32_t left[kMaxBranching];
  Shares(const Costs& a, const Costs& b, unsigned branching) noexcept {
    unsigned at = 0;
    do {
      __m128 best = _mm_set1_ps(std::numeric_limits<float>::infinity());
      __m128i share = _mm_set1_epi32(1);
      for (unsigned l = 1; l <= a.slots; ++l) {
        const __m128 sum = _mm_add_ps(_mm_set1_ps(a.cost[l - 1]), _mm_loadu_ps(b.before + kMaxBranching + at - l));
        const __m128i less = _mm_castps_si128(_mm_cmplt_ps(sum, best));
        best = _mm_min_ps(sum, best);
        share = _mm_or_si128(_mm_and_si128(less, _mm_set1_epi32(int(l))), _mm_andnot_si128(less, share));
      }
      _mm_store_ps(least + at, best);
      _mm_store_si128(reinterpret_cast<__m128i*>(left + at), share);
    } while ((at += 4) < branching);
  }
};

Collapse::Collapse(const BinaryTree& tree, const CollapseSettings& settings) : tree_(tree), settings_(settings) {
  plan_.resize(tree.node_count);
  if (tree.primitives.empty()) return;
  if (settings_.optimal) {
    choice_.resize(tree.node_count * settings_.branching);
    Costs root;
    optimise(0, root);
  } else {
    choose_leaves(0);
  }
  measure(0);
}

/// Counts what the leaf made from this node would hold. Where a subtree's leaves may repeat primitives, so does not the leaf.
void Collapse::plan_leaf(std::uint32_t index) {
  const BinaryNode& node = tree_.nodes[index];
  LeafPrimitives room;
  const bool repeats = tree_.duplicates && !node.is_leaf() && node.count <= room.size() && blocks_for(node.count) <= 2 * settings_.max_leaf_blocks;
  plan_[index].references = repeats ? unsigned(primitives(index, room).size()) : std::min(node.count, kTooMany);
}

std::span<const std::uint32_t> Collapse::primitives(std::uint32_t index, LeafPrimitives& room) const noexcept {
  const BinaryNode& node = tree_.nodes[index];
  const std::span<const std::uint32_t> references{tree_.primitives.data() + tree_.begin_of(index), node.count};
  if (!tree_.duplicates || node.is_leaf()) return references;
  std::copy(references.begin(), references.end(), room.begin());
  std::sort(room.begin(), room.begin() + node.count);
  return {room.data(), std::size_t(std::unique(room.begin(), room.begin() + node.count) - room.begin())};
}

void Collapse::optimise(std::uint32_t index, Costs& out) {
  const BinaryNode& node = tree_.nodes[index];
  const float area = node.half_area();
  plan_leaf(index);
  const float leaf_cost = area * (kLeafVisit + float(blocks(index))) * settings_.intersection_cost;
  if (node.is_leaf()) {
    out.slots = 1, out.cost[0] = leaf_cost;
    plan_[index].slots = 1, plan_[index].leaf = 1;
    return;
  }
  Costs left, right;
  if (node.count > kParallel) {
    tbb::parallel_invoke([&] { optimise(node.left, left); }, [&] { optimise(node.left + 1, right); });
  } else {
    optimise(node.left, left);
    optimise(node.left + 1, right);
  }
  const unsigned n = settings_.branching;
  std::uint8_t* choice = &choice_[std::size_t(index) * n];
  out.slots = std::min(n, left.slots + right.slots);
  const Shares shares(left, right, n);
  const float* split_cost = shares.least;
  unsigned cheapest = 2;
  for (unsigned k = 2; k <= out.slots; ++k) {
    choice[k - 1] = std::uint8_t(shares.left[k - 1] - 1);
    if (split_cost[k - 1] < split_cost[cheapest - 1]) cheapest = k;
  }
  const float inner_cost = area * settings_.traversal_cost + split_cost[cheapest - 1];
  plan_[index].leaf = node.count <= kMaxMergedReferences && blocks(index) <= settings_.max_leaf_blocks && leaf_cost <= inner_cost;
  plan_[index].slots = cheapest;
  out.cost[0] = plan_[index].leaf ? leaf_cost : inner_cost;
  // A leaf in one slot may still be opened into several, where the parent has them to spare.
  unsigned used = 1;
  for (unsigned k = 2; k <= out.slots; ++k) {
    out.cost[k - 1] = out.cost[k - 2];
    if (split_cost[k - 1] < out.cost[k - 2]) out.cost[k - 1] = split_cost[k - 1], used = k;
    choice[k - 1] = std::uint8_t(choice[k - 1] | (used - 1) << 4);
  }
}

void Collapse::choose_leaves(std::uint32_t index) {
  const BinaryNode& node = tree_.nodes[index];
  plan_[index].slots = settings_.branching;
  plan_leaf(index);
  plan_[index].leaf = node.is_leaf() || blocks(index) <= 1;
  if (plan_[index].leaf) return;
  if (node.count > kParallel) {
    tbb::parallel_invoke([&] { choose_leaves(node.left); }, [&] { choose_leaves(node.left + 1); });
  } else {
    choose_leaves(node.left);
    choose_leaves(node.left + 1);
  }
}

void Collapse::expand(std::uint32_t index, unsigned slots, Slots& out) const noexcept {
  if (slots > 1) {
    const std::uint8_t* choice = &choice_[std::size_t(index) * settings_.branching];
    if (const unsigned used = (choice[slots - 1] >> 4) + 1u; used > 1) return expand_children(index, used, out);
  }
  out.node[out.size++] = index;
}

void Collapse::expand_children(std::uint32_t index, unsigned slots, Slots& out) const noexcept {
  const unsigned left_slots = (choice_[std::size_t(index) * settings_.branching + slots - 1] & 15u) + 1;
  const std::uint32_t left = tree_.nodes[index].left;
  expand(left, left_slots, out);
  expand(left + 1, slots - left_slots, out);
}

Slots Collapse::children(std::uint32_t index) const noexcept {
  Slots out;
  if (settings_.optimal) {
    expand_children(index, unsigned(plan_[index].slots), out);
    return out;
  }
  const BinaryNode& node = tree_.nodes[index];
  out.size = 2, out.node[0] = node.left, out.node[1] = node.left + 1;
  while (out.size < settings_.branching) {  // open the largest
    int largest = -1;
    float largest_area = -1.0f;
    for (unsigned i = 0; i < out.size; ++i) {
      if (is_leaf(out.node[i])) continue;
      if (const float area = tree_.nodes[out.node[i]].half_area(); area > largest_area) largest_area = area, largest = int(i);
    }
    if (largest < 0) break;
    const std::uint32_t opened = tree_.nodes[out.node[largest]].left;
    out.node[largest] = opened;
    out.node[out.size++] = opened + 1;
  }
  return out;
}

std::uint64_t Collapse::measure(std::uint32_t index) {
  const auto round_up = [granule = settings_.granule](std::uint64_t bytes) { return (bytes + granule - 1) / granule * granule; };
  std::uint64_t total;
  if (is_leaf(index)) {
    total = round_up(blocks(index) * settings_.block_bytes);
  } else {
    total = round_up(settings_.node_bytes);
    const Slots slots = children(index);
    if (tree_.nodes[index].count > kParallel) {
      std::uint64_t part[kMaxBranching];
      tbb::parallel_for(0u, slots.size, [&](unsigned i) { part[i] = measure(slots.node[i]); });
      for (unsigned i = 0; i < slots.size; ++i) total += part[i];
    } else {
      for (unsigned i = 0; i < slots.size; ++i) total += measure(slots.node[i]);
    }
  }
  plan_[index].bytes = total;
  return total;
}

}  // namespace arboretum
