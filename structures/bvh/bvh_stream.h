// Stream traversal: rays of one octant share nodes. A group of up to 64 of them has one stack of nodes, each with a
// mask of the rays that are to visit it, after the any-hit streams of Embree 3 (groups of 32 rays; there a ray alone
// leaves the stream).
//
// A batch's rays are sorted into eight lists as they come; a full list is a group. A node tests each of its rays
// against all its children, the planes in registers, so that its cache lines, its place on the stack and its
// mispredicted branches are paid once for all of them. A closest hit takes the children nearest first by the least
// distance at which any ray enters; rays that have found something nearer leave the mask when the node's turn comes.
// Several groups take turns, a node each, so that the lines that one asks for arrive while others work: that hides what
// rays of their own wait for as rays in flight do (bvh_queued.h), at a third of the instructions a node. What a group
// visits next is known when its turn ends, and those lines alone are asked for. A ray may visit a node that it would
// not have alone; it finds the same hit, since a box is dropped only where it begins beyond the nearest hit.
#pragma once

#include "structures/bvh/bvh_packet_nodes.h"
#include "structures/bvh/stream_stack.h"
#include "traversal/box_rays.h"
#include "traversal/kernel_rows.h"
#include "traversal/usual_leaves.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

inline constexpr std::string_view kStreamSorted = "stream_sorted";
/// Groups that take turns (docs/performance.md).
inline constexpr unsigned kGroupsInTurn = 12;

/// `Format`: how nodes are read (bvh_packet_nodes.h).
template <class Format, class Leaves, bool Padded, bool AnyHit, class Counting>
class Stream {
  static constexpr int N = Format::kBranching;

 public:
  /// Where somebody asks how its rays share (bvh_streams_or_queue.h).
  static constexpr bool kCountsTurns = kRegisterWidth == 4;

  /// 1 to 2^31 rays.
  Stream(const bvh::BvhBase& tree, const KernelRow& row, RayBatch rays, Counting counting)
      : base_(tree.base()),
        root_(tree.root()), pad_{tree.max_coordinate(), Padded && !kMoves && row.tests->depth_between_corners},
        leaves_(leaves_of<Leaves>(tree, row)), form_(*row.tests->form), counting_(counting), rays_(rays),
        order_(row.traversal == kStreamSorted ? ray_order(rays) : std::vector<std::uint32_t>()),
        count_(unsigned(std::min(std::size_t{kGroupsInTurn}, rays.size()))), stack_entries_(tree.stack_entries()),
        stacks_(std::make_unique_for_overwrite<std::uint32_t[]>(count_ * StreamStack::words(stack_entries_))),
        groups_(std::make_unique_for_overwrite<Group[]>(count_)) {}

  /// report(index of the ray, its nearest hit): any hit has a primitive where something was hit.
  template <class Report>
  void run(const Report& report) {
    Group* turn[kGroupsInTurn];
    unsigned groups = 0;
    for (unsigned i = 0;
         i < count_ &&
         fill(groups_[i], StreamStack(stacks_.get() + i * StreamStack::words(stack_entries_), stack_entries_));
         ++i)
      turn[groups++] = &groups_[i];
    while (groups != 0) {
      for (unsigned i = 0; i < groups;) {
        Group& group = *turn[i];
        if (step(group)) {
          ++i;
          continue;
        }
        finish(group, report);
        if (!fill(group, group.stack)) turn[i] = turn[--groups];
      }
    }
  }

  /// How many rays of a group visited a node or leaf together, on average.
  [[nodiscard]] float rays_a_turn() const requires kCountsTurns {
    return float(rays_in_turns_) / float(std::max(turns_, std::uint64_t{1}));
  }

 private:
  static constexpr unsigned kRays = BoxRays::kMost;
  /// of a node, or of a leaf's first block, wherever they begin
  static constexpr int kLines = lines_of(std::max(Format::kBytes, Leaves::kBytesAhead));
  using Box = BoxRay<N, Padded>;
  static constexpr int W = Format::kLanes;
  using F = vf<W>;

  /// The far planes' offsets are not the near ones'.
  static constexpr bool kTwoOffsets = Padded || !kHasFma;
  /// Moving planes round by more than pads that are tight along the ray allow for.
  static constexpr bool kMoves = kBoxesMove<Format>;
  /// What nodes need of a ray, in one cache line: BoxRay's r, the distance from which boxes count, the near planes'
  /// offsets and the far ones', and, where boxes move, the ray's time; where the offsets are the same there is room for
  /// the ray.
  static constexpr int kTime = kTwoOffsets ? 11 : 7;
  struct alignas(64) Constants {
    float number[12];
  };
  struct alignas(64) ConstantsAndRay {
    float number[8];
    Ray ray;
  };
  using Line = std::conditional_t<kTwoOffsets, Constants, ConstantsAndRay>;
  struct Nothing {};
  using RayData = typename Leaves::RayData;
  /// What the intersector keeps for a ray is more than the ray itself.
  static constexpr bool kKeepsData = sizeof(RayData) > sizeof(Ray);
  struct alignas(64) Group {
    Line line[kRays];
    [[no_unique_address]] std::conditional_t<kTwoOffsets, std::array<Ray, kRays>, Nothing> rays;
    float t[kRays] = {};  ///< the distance up to which boxes count: to the nearest hit so far; all are compared
    NearestHit best[kRays];
    std::uint32_t index[kRays];
    alignas(64) std::byte data[kKeepsData ? kRays * sizeof(RayData) : 1];
    unsigned count = 0, octant = 0;
    std::uint64_t active = 0;  ///< rays whose search is not over
    StreamStack stack;
    unsigned top;                ///< entries of the stack
    bvh::NodeReference target;   ///< what it visits next
    std::uint64_t visitors = 0;  ///< the rays that do
    typename Counting::Depths depths{typename Counting::Depth{}};
  };

  static ARBORETUM_INLINE Ray& ray(Group& g, unsigned i) {
    if constexpr (kTwoOffsets) {
      return g.rays[i];
    } else {
      return g.line[i].ray;
    }
  }

  /// What the intersector keeps for ray i.
  ARBORETUM_INLINE decltype(auto) data(Group& g, unsigned i) const {
    if constexpr (kKeepsData) {
      return (*reinterpret_cast<RayData*>(g.data + i * sizeof(RayData)));
    } else {
      return leaves_.prepare(ray(g, i));
    }
  }

  /// The next group's rays; false when there are none left.
  bool fill(Group& group, StreamStack stack) {
    while (next_ < rays_.size()) {
      const std::uint32_t i = order_.empty() ? std::uint32_t(next_) : order_[next_];
      ++next_;
      const unsigned octant = sign_mask(vf<4>::load(&rays_[i].direction)) & 7u;
      list_[octant][waiting_[octant]] = i;
      if (++waiting_[octant] == kRays) return begin(group, octant, stack), true;
    }
    for (unsigned octant = 0; octant < 8; ++octant)
      if (waiting_[octant] != 0) return begin(group, octant, stack), true;
    return false;
  }

  void begin(Group& g, unsigned octant, StreamStack stack) {
    const std::uint32_t* const list = list_[octant];
    const int count = int(std::exchange(waiting_[octant], 0u));
    const auto ray_at = [&](int i) -> const Ray& { return rays_[list[i]]; };
    lanes_.template prepare<kNativeWidth, N>(count, ray_at, Padded, pad_, [](int) {});
    for (int k = 0; k < count; k += 4) gather(g, k);
    for (int i = 0; i < count; ++i) {
      [[maybe_unused]] const float time = rays_.time(list[i]);
      if constexpr (kMoves) g.line[i].number[kTime] = within_frames(time);
      g.index[i] = list[i], ray(g, unsigned(i)) = ray_at(i);
      g.best[i] = NearestHit{lanes_.t[i]};
      if constexpr (kKeepsData) {
        if (lanes_.valid >> i & 1u)
          new (static_cast<void*>(g.data + std::size_t(i) * sizeof(RayData)))
              std::remove_const_t<RayData>(prepare_at(leaves_, ray_at(i), time));
      }
    }
    for (int k = 0; k < count; k += kNativeWidth)
      (vf<kNativeWidth>::load(lanes_.t + k) * vf<kNativeWidth>(pad_.beyond())).store(g.t + k);
    g.count = unsigned(count), g.octant = octant, g.active = lanes_.valid;
    g.stack = stack, g.top = 0;
    g.target = root_, g.visitors = g.active;
    g.depths = typename Counting::Depths(typename Counting::Depth{});
  }

  /// The constants of the four rays from k on into their cache lines.
  void gather(Group& g, int k) {
    const auto four = [&](int at, const float* a, const float* b, const float* c, const float* d) {
      vf<4> row[4] = {vf<4>::load(a + k), vf<4>::load(b + k), vf<4>::load(c + k), vf<4>::load(d + k)};
      transpose(row);
      for (int i = 0; i < 4; ++i) row[i].store(g.line[k + i].number + at);
    };
    four(0, lanes_.r[0], lanes_.r[1], lanes_.r[2], lanes_.first);
    four(4, lanes_.near[0], lanes_.near[1], lanes_.near[2], lanes_.far[0]);
    if constexpr (kTwoOffsets) four(8, lanes_.far[1], lanes_.far[2], lanes_.far[2], lanes_.far[2]);
  }

  template <class Report>
  void finish(Group& g, const Report& report) {
    if constexpr (!AnyHit) {
      finish_hits(
          leaves_, ~std::uint64_t{0} >> (kRays - g.count), [&](int i) -> const Ray& { return ray(g, unsigned(i)); },
          [&](int i) -> decltype(auto) { return data(g, unsigned(i)); },
          [&](int i) -> NearestHit& { return g.best[i]; });
    }
    for (unsigned i = 0; i < g.count; ++i) report(g.index[i], g.best[i]);
  }

  /// One node or leaf; false when nothing waits any more.
  ARBORETUM_INLINE bool step(Group& g) {
    if (g.visitors == 0) return false;  // no valid ray
    if constexpr (kCountsTurns) ++turns_, rays_in_turns_ += unsigned(__builtin_popcountll(g.visitors));
    if (bvh::is_leaf(g.target)) {
      leaf(g, g.target, g.visitors);
    } else {
      node(g, g.target, g.visitors);
    }
    return next(g);
  }

  /// Finds what the group visits when its turn comes again, and asks for its lines: no others, since what waits longer
  /// would be gone by then.
  ARBORETUM_INLINE bool next(Group& g) {
    for (unsigned top = g.top; top-- != 0;) {
      g.depths.pop(top);
      const std::uint64_t rays = g.stack.rays(top) & (AnyHit ? g.active : nearer(g, g.stack.t[top]));
      if (rays == 0) continue;
      g.top = top, g.target = g.stack.target[top], g.visitors = rays;
      prefetch_lines<kLines>(base_ + bvh::offset_of(g.target));
      return true;
    }
    return false;
  }

  /// The rays that have found nothing before t.
  static ARBORETUM_INLINE std::uint64_t nearer(const Group& g, float t) {
    constexpr int V = kNativeWidth;
    std::uint64_t rays = 0;
    for (int k = 0; k < int(kRays); k += V) rays |= std::uint64_t((vf<V>(t) <= vf<V>::load(g.t + k)).bits()) << k;
    return rays;
  }

  ARBORETUM_INLINE void node(Group& g, bvh::NodeReference target, std::uint64_t rays) {
    [[maybe_unused]] constexpr unsigned kChildren = (1u << N) - 1u, kSlots = Format::template Single<Padded>::kSlots;
    const std::byte* const node = base_ + bvh::offset_of(target);
    const NodePlanes<Format> planes(node, g.octant);
    MetChildren<N, AnyHit> met;
    for (std::uint64_t rest = rays; rest; rest &= rest - 1) {
      const unsigned i = unsigned(__builtin_ctzll(rest));
      const float *const c = g.line[i].number, *const f = c + 4, *const far = kTwoOffsets ? f + 3 : f;
      const BoxLanes<N, Padded> box(Box({c[0], c[1], c[2]}, {f[0], f[1], f[2]}, {far[0], far[1], far[2]}));
      F entry;
      const vm<W> meets = planes.met(box, c[kTime], F(c[3]), F(g.t[i]), entry);
      met.add(i, meets, entry);
      if constexpr (Counting::kCounting)
        counting_.node(Format::boxes(node), kSlots, unsigned(__builtin_popcount(meets.bits() & kChildren)));
    }
    if constexpr (Counting::kCounting) {
      const auto count = unsigned(__builtin_popcountll(rays));
      counting_.share_node(count);
      counting_.at_depth(g.depths.current(), count * kSlots, count * Format::boxes(node));
    }
    const unsigned first = g.top;
    g.top = met.template push<Format::kStride>(g.stack, first, Format::children(node), rays);
    g.depths.push(first, g.top);
  }

  /// A function of its own: in the loop it would share registers with it, and GCC then keeps the mask of rays in memory
  /// (docs/performance.md).
  [[gnu::noinline]] void leaf(Group& g, bvh::NodeReference target, std::uint64_t rays) {
    const std::byte* const blocks = base_ + bvh::offset_of(target);
    const unsigned count = bvh::block_count(target);
    if constexpr (Counting::kCounting) counting_.share_leaf(unsigned(__builtin_popcountll(rays)));
    const auto hit = [&g, beyond = pad_.beyond()](int i) {
      if constexpr (AnyHit) {
        g.best[i].primitive = 0, g.active &= ~(std::uint64_t{1} << i);
      } else {
        g.t[i] = g.best[i].t * beyond;
      }
    };
    test_leaf<AnyHit, true>(
        leaves_, form_, counting_, blocks, count, rays, [&](int i) -> const Ray& { return ray(g, unsigned(i)); },
        [&](int i) -> decltype(auto) { return data(g, unsigned(i)); }, [&](int i) -> NearestHit& { return g.best[i]; },
        hit);
  }

  const std::byte* const base_;
  const bvh::NodeReference root_;
  const BoxPad pad_;
  const Leaves leaves_;
  const LeafForm& form_;
  const Counting counting_;
  const RayBatch rays_;
  const std::vector<std::uint32_t> order_;  ///< the i-th ray to be taken is order_[i], or i where it is empty
  const unsigned count_;
  const std::size_t stack_entries_;
  const std::unique_ptr<std::uint32_t[]> stacks_;
  const std::unique_ptr<Group[]> groups_;
  std::uint64_t turns_ = 0, rays_in_turns_ = 0;  ///< where kCountsTurns
  std::size_t next_ = 0;
  std::uint32_t list_[8][kRays];
  unsigned waiting_[8] = {};
  BoxRays lanes_;
};

/// Of a kind of stream, `Streams<Format, Leaves, Padded, AnyHit, Counting>`, the functions of the kernel table.
template <template <class, class, bool, bool, class> class Streams, class Format>
struct StreamFunctions {
  template <class Leaves, bool Padded>
  static RowFunctions timed() {
    return functions<Leaves, Padded, NoCounters>();
  }
  template <bool Padded>
  static RowFunctions counting() {
    return functions<CalledLeaves, Padded, WithCounters>();
  }

 private:
  template <class Leaves, bool Padded, class Counting>
  static RowFunctions functions() {
    return {
        [](const Accel& a, const KernelRow& row, RayBatch rays, std::span<Hit> hits, Counters* counters) {
          trace<Leaves, Padded, false, Counting>(
              a, row, rays, counters, [&](std::size_t i, const NearestHit& best) { hits[i] = stored_to_hit(best); });
        },
        [](const Accel& a, const KernelRow& row, RayBatch rays, std::span<std::uint8_t> occluded, Counters* counters) {
          trace<Leaves, Padded, true, Counting>(a, row, rays, counters, [&](std::size_t i, const NearestHit& best) {
            occluded[i] = best.primitive != NearestHit::kNone;
          });
        }};
  }
  template <class Leaves, bool Padded, bool AnyHit, class Counting, class Report>
  static ARBORETUM_INLINE void trace(const Accel& a, const KernelRow& row, RayBatch rays, Counters* counters,
                                     const Report& report) {
    constexpr std::size_t kAtOnce = std::size_t{1} << 31;  // a group numbers its rays in 32 bits
    for (std::size_t begin = 0; begin < rays.size(); begin += kAtOnce) {
      Streams<Format, Leaves, Padded, AnyHit, Counting> stream(static_cast<const bvh::BvhBase&>(a), row,
                                                               rays.part(begin, std::min(kAtOnce, rays.size() - begin)),
                                                               Counting(counters));
      stream.run([&](std::size_t i, const NearestHit& best) { report(begin + i, best); });
    }
    if constexpr (Counting::kCounting) counters->rays += rays.size(), counters->rays_in_streams += rays.size();
  }
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
