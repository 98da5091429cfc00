// Streams that regroup: rays of a batch go down the tree together in lists, after Barringer and Akenine-Moeller,
// "Dynamic Ray Stream Traversal", ACM TOG 33(4), 2014. bvh_stream.h shares nodes by masks instead, and is faster.
//
// A group is parted by the octant of its rays' directions. Each part begins as one list of rays at the root; a node
// tests every ray of its list against all its children, with the planes in registers, and sorts the rays into a list
// for each child; lists wait on a stack, children near to far, so that a node's cache lines and its mispredicted
// branches are paid once for all its rays. Rays that took different ways meet again in the next child that they share.
// A list of few rays is finished one ray after the other.
//
// Where we differ: nodes are wide, and the order of children is one for the whole list (of their centres along the mean
// direction of the part) where theirs is each ray's own, so that a child is visited once. A ray may then visit a node
// that it would not have alone: it finds the same hit, since a box is dropped only where it begins beyond the nearest
// hit. Rays that are done (any hit) or have found something nearer than the box leave a list when its turn comes.
#pragma once

#include "structures/bvh/bvh_stream.h"
#include "traversal/kernel_rows.h"
#include "traversal/usual_leaves.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Rays of a group, and of a list that is no longer worth its own (docs/performance.md).
inline constexpr std::size_t kStreamRays = 1024;
inline constexpr unsigned kFewRays = 4;

/// `Format`: how nodes are read (bvh_packet_nodes.h).
template <class Format, class Leaves, bool Padded, bool AnyHit, class Counting>
class StreamLists {
  static constexpr int N = Format::kBranching;

 public:
  /// There is at least one ray.
  StreamLists(const bvh::BvhBase& tree, const KernelRow& row, RayBatch rays, Counting counting)
      : base_(tree.base()), root_(tree.root()), max_coordinate_(tree.max_coordinate()),
        leaves_(leaves_of<Leaves>(tree, row)), form_(*row.tests->form), counting_(counting), rays_(rays),
        group_(unsigned(std::min(kStreamRays, rays.size()))), lists_(tree.stack_entries()), entries_(4 * group_),
        children_(std::size_t(N + 1) * group_), stack_(tree.stack_entries()),
        room_(group_ * (sizeof(State) + sizeof(LeafState))), states_(reinterpret_cast<State*>(room_.data())),
        leaf_states_(reinterpret_cast<LeafState*>(room_.data() + group_ * sizeof(State))) {}

  /// report(index of the ray, its nearest hit): any hit has a primitive where something was hit.
  template <class Report>
  void run(Report&& report) {
    for (std::size_t begin = 0; begin < rays_.size(); begin += group_)
      group(begin, std::min(rays_.size(), begin + group_), report);
  }

 private:
  using Test = typename Format::template Single<Padded>;
  static constexpr bool kMoves = kBoxesMove<Format>;
  using Box = BoxRay<N, Padded>;
  static constexpr int W = Format::kLanes;
  using F = vf<W>;

  /// What nodes need of a ray: a cache line.
  struct alignas(64) State {
    Box box;
    float first;          ///< distance from which boxes count
    float nearest;        ///< beyond which they do not; -inf when the search is over
    std::uint32_t place;  ///< in the group
    float time;           ///< where boxes move
  };
  static_assert(sizeof(State) == 64);
  /// What leaves need.
  struct LeafState {
    NearestHit best;
    float tnear;
    typename Leaves::RayData data;
    ARBORETUM_INLINE LeafState(const Ray& ray, float time, const Leaves& leaves)
        : best{ray.tfar}, tnear(ray.tnear), data(prepare_at(leaves, ray, time)) {}
  };
  /// Rays that are to visit a node or leaf: entries_[begin ...], the key of each the distance at which it enters.
  struct List {
    bvh::NodeReference target;
    std::uint32_t begin, count;
  };

  template <class Report>
  void group(std::size_t begin, std::size_t end, Report&& report) {
    unsigned rays = 0, of_octant[8] = {};
    Vec3f direction[8] = {};
    for (std::size_t i = begin; i < end; ++i) {
      const Ray& ray = rays_[i];
      if (!is_valid_in_lanes(ray)) {
        report(i, NearestHit{ray.tfar});
        continue;
      }
      const float time = rays_.time(i);
      State& s = *new (&states_[rays]) State{Box(ray, max_coordinate_), first_distance(ray), ray.tfar,
                                             std::uint32_t(i - begin), kMoves ? within_frames(time) : 0.0f};
      new (&leaf_states_[rays++]) LeafState(ray, time, leaves_);
      ++of_octant[s.box.octant];
      direction[s.box.octant] = direction[s.box.octant] + ray.direction;
    }
    unsigned at[8] = {};
    for (int o = 1; o < 8; ++o) at[o] = at[o - 1] + of_octant[o - 1];
    for (unsigned i = 0; i < rays; ++i)
      entries_[at[states_[i].box.octant]++] = stack_entry(__builtin_bit_cast(std::uint32_t, states_[i].first), i);
    for (int o = 0; o < 8; ++o) {
      if (of_octant[o]) octant({root_, at[o] - of_octant[o], of_octant[o]}, direction[o], rays);
    }
    for (unsigned i = 0; i < rays; ++i) {
      LeafState& leaf = leaf_states_[i];
      if constexpr (!AnyHit) leaves_.finish(leaf.data, leaf.best);
      report(begin + states_[i].place, leaf.best);
    }
  }

  /// Everything that the rays of `root` meet. They have the same octant. Entries from `free` on are unused.
  void octant(const List& root, Vec3f direction, unsigned free) {
    const unsigned octant = states_[ray_of(entries_[root.begin])].box.octant;
    List* const bottom = lists_.data();
    List* top = bottom;
    *top++ = root;
    typename Counting::Depths depths{typename Counting::Depth{}};
    while (top != bottom) {
      List list = *--top;
      if (list.target != root.target) depths.pop(top - bottom);
      drop(list);
      if (list.count <= kFewRays) {
        for (unsigned i = 0; i < list.count; ++i)
          alone(ray_of(entries_[list.begin + i]), list.target, depths.current());
      } else if (bvh::is_leaf(list.target)) {
        leaf(list);
      } else {
        List* const first = top;
        node(list, octant, direction, list.begin < free ? free : list.begin, top, depths.current());
        depths.push(first - bottom, top - bottom);
      }
    }
  }

  static ARBORETUM_INLINE unsigned ray_of(StackEntry e) { return std::uint32_t(e); }
  static ARBORETUM_INLINE float key_of(StackEntry e) { return __builtin_bit_cast(float, std::uint32_t(e >> 32)); }

  /// Takes from the list whose search is over or has found something nearer.
  ARBORETUM_INLINE void drop(List& list) {
    StackEntry* const first = entries_.data() + list.begin;
    StackEntry* out = first;
    for (const StackEntry *e = first, *end = first + list.count; e != end; ++e) {
      const StackEntry entry = *e;
      *out = entry;
      out += key_of(entry) <= states_[ray_of(entry)].nearest;
    }
    list.count = unsigned(out - first);
  }

  void node(const List& list, unsigned octant, Vec3f direction, unsigned free, List*& top,
            typename Counting::Depth depth) {
    const std::byte* const node = base_ + bvh::offset_of(list.target);
    const NodePlanes<Format> planes(node, octant);
    StackEntry* tail[N + 1];
    for (int i = 0; i <= N; ++i) tail[i] = children_.data() + std::size_t(i) * group_;
    alignas(64) std::uint32_t key[W + 1];
    key[W] = 0;
    for (const StackEntry *e = entries_.data() + list.begin, *end = e + list.count; e != end; ++e) {
      const unsigned ray = ray_of(*e);
      const State& s = states_[ray];
      F entry;
      unsigned hit = planes.met(BoxLanes<N, Padded>(s.box), s.time, F(s.first), F(s.nearest), entry).bits();
      if constexpr (N != W) hit &= (1u << N) - 1u;
      if constexpr (Counting::kCounting)
        counting_.node(Format::boxes(node), Test::kSlots, unsigned(__builtin_popcount(hit)));
      entry.store(key);
      // Two without a branch, which most rays need no more than; what is not there goes to the list behind the last.
      const auto append = [&] {
        const unsigned i = unsigned(__builtin_ctz(hit | 1u << N));
        *tail[i] = stack_entry(key[i], ray);
        tail[i] += hit != 0;
        hit &= hit - 1;
      };
      append(), append();
      while (hit) append();
    }
    if constexpr (Counting::kCounting) {
      counting_.share_node(list.count);
      counting_.at_depth(depth, list.count * Test::kSlots, list.count * Format::boxes(node));
    }
    push(node, planes.centres(direction), tail, free, top);
  }

  /// The children's lists onto the stack, the nearest on top, by where their centres lie along the rays.
  ARBORETUM_INLINE void push(const std::byte* node, F centres, StackEntry* const (&tail)[N + 1], unsigned free,
                             List*& top) {
    alignas(64) float along[W];
    centres.store(along);
    const bvh::NodeReference* const child = Format::children(node);
    unsigned order[N], children = 0;
    std::size_t total = 0;
    for (unsigned i = 0; i < unsigned(N); ++i) {
      const std::size_t count = std::size_t(tail[i] - (children_.data() + std::size_t(i) * group_));
      if (count == 0) continue;
      total += count;
      unsigned at = children++;
      for (; at && along[order[at - 1]] < along[i]; --at) order[at] = order[at - 1];
      order[at] = i;
    }
    if (entries_.size() < free + total) entries_.resize(2 * (free + total));
    for (unsigned k = 0; k < children; ++k) {
      const unsigned i = order[k];
      const bvh::NodeReference reference = child[i * unsigned(Format::kStride)];
      prefetch_lines<kPrefetchLines>(base_ + bvh::offset_of(reference));
      const StackEntry* const from = children_.data() + std::size_t(i) * group_;
      const auto count = unsigned(tail[i] - from);
      std::copy(from, from + count, entries_.data() + free);
      *top++ = {reference, free, count};
      free += count;
    }
  }

  void leaf(const List& list) {
    const std::byte* const blocks = base_ + bvh::offset_of(list.target);
    const unsigned count = bvh::block_count(list.target);
    if constexpr (Counting::kCounting) counting_.share_leaf(list.count);
    for (unsigned i = 0; i < list.count; ++i) leaf(ray_of(entries_[list.begin + i]), blocks, count);
  }

  /// Returns whether the nearest hit changed.
  ARBORETUM_INLINE bool leaf(unsigned ray, const std::byte* blocks, unsigned count) {
    State& s = states_[ray];
    LeafState& l = leaf_states_[ray];
    if constexpr (AnyHit) {
      if (!any_hit_in_leaf(leaves_, l.data, form_, counting_, blocks, count, l.tnear, s.nearest)) return false;
      l.best.primitive = 0;
      s.nearest = -std::numeric_limits<float>::infinity();
      return true;
    } else {
      if constexpr (Counting::kCounting) counting_.leaf(form_, blocks, count);
      if (!leaves_.closest_hit(l.data, blocks, count, l.tnear, l.best)) return false;
      s.nearest = l.best.t;
      return true;
    }
  }

  /// One ray from `target` on.
  void alone(unsigned ray, bvh::NodeReference target, typename Counting::Depth depth) {
    State& s = states_[ray];
    auto nodes = [&] {
      if constexpr (kMoves) {
        return Test(s.box, s.first, s.nearest, s.time);
      } else {
        return Test(s.box, s.first, s.nearest);
      }
    }();
    walk_bvh<AnyHit>(
        base_, target, nodes, stack_.data(), leaf_states_[ray].best.t, counting_,
        [&](bvh::NodeReference reference) {
          if (!leaf(ray, base_ + bvh::offset_of(reference), bvh::block_count(reference))) return false;
          if constexpr (!AnyHit) nodes.shorten(s.nearest);
          return AnyHit;
        },
        depth);
  }

  const std::byte* const base_;
  const bvh::NodeReference root_;
  const float max_coordinate_;
  const Leaves leaves_;
  const LeafForm& form_;
  const Counting counting_;
  const RayBatch rays_;
  const unsigned group_;
  std::vector<List> lists_;
  std::vector<StackEntry> entries_;   ///< of the lists that wait, those on top last
  std::vector<StackEntry> children_;  ///< those of the node at hand, group_ a child
  TraversalStack stack_;
  Arena room_;
  State* const states_;
  LeafState* const leaf_states_;
};

/// What they have compiled in: one leaf, since each costs a unit two seconds to compile.
using StreamListLeaves =
    std::conditional_t<kRegisterWidth == 1, TypeList<>,
                       std::conditional_t<kRegisterWidth == 4, TypeList<CompiledLeaves<EdgeBlock<4>, MollerTrumbore>>,
                                          TypeList<CompiledLeaves<EdgeBlock<8>, MollerTrumbore>>>>;

/// `stream` takes the rays as they come, `stream_sorted` by octant and origin. `One` and `Lists`: Stream and
/// StreamLists, or these with leaves of their own.
template <class Structure, class Format, class Compiled = BatchLeaves, class CompiledLists = StreamListLeaves,
          template <class, class, bool, bool, class> class One = Stream,
          template <class, class, bool, bool, class> class Lists = StreamLists>
void add_stream_rows(KernelRows& rows) {
  add_rows<Structure, StreamFunctions<One, Format>>(rows, "stream", Compiled{});
  add_rows<Structure, StreamFunctions<One, Format>>(rows, kStreamSorted, Compiled{});
  add_rows<Structure, StreamFunctions<Lists, Format>>(rows, "stream_lists", CompiledLists{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
