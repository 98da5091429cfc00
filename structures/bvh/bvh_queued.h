// Queued traversal of the wide BVHs: as traversal/queued_rays.h, which says what it is for, with a loop of its own. A
// reference's own bits tell the kind of a step here, the end of a stack is a reference too, and the stack is cleared of
// what lies behind a new hit, so that a step has no branch but those of its test.
#pragma once

#include "simd/lane_order.h"
#include "traversal/usual_leaves.h"
#include "structures/bvh/bvh_single.h"
#include "traversal/queued_functions.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Marks the end of a ray's stack: neither a node nor a leaf.
inline constexpr bvh::NodeReference kDone = 16;

/// The kinds of step, as the reference's own bits tell them: node 0, leaf 1, done 2.
[[nodiscard]] ARBORETUM_INLINE unsigned kind_of(bvh::NodeReference r) { return r >> 3 & 3u; }

/// The children of `hit` onto the stack, the nearest on top: the order of push_children(). For any hit as they stand in
/// the node: walk_bvh()'s.
template <int N, bool AnyHit>
ARBORETUM_INLINE void push_in_scalars(const bvh::NodeReference* child, const std::uint32_t* key, unsigned hit,
                                      StackEntry*& top) {
  for (StackEntry* const bottom = top; hit; hit &= hit - 1) {
    const int i = __builtin_ctz(hit);
    const StackEntry e = stack_entry(key[i], child[i]);
    StackEntry* p = top++;
    if constexpr (!AnyHit) {
      for (; p != bottom && p[-1] < e; --p) *p = p[-1];
    }
    *p = e;
  }
}

#if ARBORETUM_TARGET >= ARBORETUM_TARGET_AVX2
/// Four entries, the largest first. Positive doubles order as their bits do, and no distance of a float is a double's
/// NaN.
ARBORETUM_INLINE __m256d sort_down(__m256d e) {
  __m256d p = _mm256_permute4x64_pd(e, 0x4e);  // 2 3 0 1
  e = _mm256_blend_pd(_mm256_max_pd(e, p), _mm256_min_pd(e, p), 0b1100);
  p = _mm256_permute_pd(e, 0b0101);  // 1 0 3 2
  e = _mm256_blend_pd(_mm256_max_pd(e, p), _mm256_min_pd(e, p), 0b1010);
  p = _mm256_permute4x64_pd(e, 0xd8);  // 0 2 1 3
  return _mm256_blend_pd(_mm256_max_pd(e, p), _mm256_min_pd(e, p), 0b0100);
}

/// Up to four children of `hit` to where the top is, the nearest last; always four entries are written.
template <bool AnyHit, int W>
ARBORETUM_INLINE void push_four(vi<W> references, vf<W> entry, unsigned hit, StackEntry* top) {
  const __m128i r = first<4>(compress(hit, references)).v, k = first<4>(compress(hit, entry.as_int())).v;
  const __m256d e = _mm256_castsi256_pd(_mm256_set_m128i(_mm_unpackhi_epi32(r, k), _mm_unpacklo_epi32(r, k)));
  _mm256_storeu_pd(reinterpret_cast<double*>(top), AnyHit ? e : sort_down(e));
}
#endif

#if ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
/// Which lane, in bytes, comes to each place when the first four lanes of a mask are moved together; 0xff where there
/// are fewer.
struct CompressBytesTable {
  alignas(16) std::uint8_t bytes[256][16] = {};
  constexpr CompressBytesTable() {
    for (unsigned m = 0; m < 256; ++m) {
      unsigned n = 0;
      for (unsigned i = 0; i < 8 && n < 4; ++i) {
        if (!(m >> i & 1)) continue;
        for (unsigned b = 0; b < 4; ++b) bytes[m][4 * n + b] = std::uint8_t(4 * i + b);
        ++n;
      }
      for (; n < 4; ++n)
        for (unsigned b = 0; b < 4; ++b) bytes[m][4 * n + b] = 0xff;
    }
  }
};
inline constexpr CompressBytesTable kCompressBytes;

/// Of eight lanes those that `from` (a row of the table) names. A byte of an index with its highest bit gives 0, else
/// its low four bits count.
ARBORETUM_INLINE __m128i compress_bytes(__m128i low, __m128i high, __m128i from) {
  return _mm_or_si128(_mm_shuffle_epi8(low, _mm_adds_epu8(from, _mm_set1_epi8(0x70))),
                      _mm_shuffle_epi8(high, _mm_sub_epi8(from, _mm_set1_epi8(16))));
}

/// Four entries, the largest first: a[0], a[1], b[0], b[1]. Positive doubles order as their bits do.
ARBORETUM_INLINE void sort_down(__m128d& a, __m128d& b) {
  const __m128d high = _mm_max_pd(a, b), low = _mm_min_pd(a, b);
  const __m128d even = _mm_unpacklo_pd(high, low), odd = _mm_unpackhi_pd(high, low);
  // The most and one in between, one in between and the least
  const __m128d more = _mm_max_pd(even, odd), less = _mm_min_pd(even, odd);
  const __m128d between = _mm_unpackhi_pd(more, more);
  a = _mm_unpacklo_pd(more, _mm_max_sd(between, less)), b = _mm_shuffle_pd(_mm_min_sd(between, less), less, 0b10);
}
#endif

/// The same for all: up to four children, the usual case, without a branch where the registers can do it. Writes up to
/// four entries whatever their number.
template <int N, bool AnyHit>
ARBORETUM_INLINE void push(const bvh::NodeReference* child, vf<lanes_for(N)> entry, unsigned hit, StackEntry*& top) {
  constexpr int W = lanes_for(N);
  [[maybe_unused]] const unsigned count = unsigned(__builtin_popcount(hit));
#if ARBORETUM_TARGET >= ARBORETUM_TARGET_AVX2
  if constexpr (kOrdersLanes<N>) {
    if (__builtin_expect(count <= 4, 1)) {
      push_four<AnyHit>(vi<N>::load(child), entry, hit, top);
      top += count;
      return;
    }
  }
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
  if constexpr (N == 4 || N == 8) {
    if (__builtin_expect(count <= 4, 1)) {
      __m128i keys, references;
      const __m128i from = _mm_load_si128(reinterpret_cast<const __m128i*>(kCompressBytes.bytes[hit]));
      const auto* reference = reinterpret_cast<const __m128i*>(child);
      if constexpr (N == 4) {
        references = _mm_shuffle_epi8(_mm_loadu_si128(reference), from);
        keys = _mm_shuffle_epi8(_mm_castps_si128(entry.v), from);
      } else {
        references = compress_bytes(_mm_loadu_si128(reference), _mm_loadu_si128(reference + 1), from);
        keys = compress_bytes(_mm_castps_si128(entry.lo.v), _mm_castps_si128(entry.hi.v), from);
      }
      __m128d a = _mm_castsi128_pd(_mm_unpacklo_epi32(references, keys)),
              b = _mm_castsi128_pd(_mm_unpackhi_epi32(references, keys));
      if constexpr (!AnyHit) sort_down(a, b);
      _mm_storeu_pd(reinterpret_cast<double*>(top), a), _mm_storeu_pd(reinterpret_cast<double*>(top + 2), b);
      top += count;
      return;
    }
  }
#endif
  alignas(64) std::uint32_t key[W];
  entry.store(key);
  push_in_scalars<N, AnyHit>(child, key, hit, top);
}

template <int N, class Leaves, bool Padded, bool AnyHit>
class Queued {
 public:
  /// `in_flight`: 1 to kMostInFlight.
  Queued(const Accel& accel, const KernelRow& row, RayBatch rays, unsigned in_flight)
      : Queued(static_cast<const bvh::BvhBase&>(accel), row, rays, in_flight) {}
  Queued(const bvh::BvhBase& tree, const KernelRow& row, RayBatch rays, unsigned in_flight)
      : in_flight_(in_flight), base_(tree.base()), leaves_(row, tree.vertices()), root_(tree.root()),
        max_coordinate_(tree.max_coordinate()), rays_(rays),
        stride_(stride_of<StackEntry>(tree.stack_entries() + kSpareEntries)), stacks_(stride_ * in_flight) {}

  /// report(index of the ray, its nearest hit): any hit has a primitive where something was hit. Of `counting` the
  /// queues' lengths alone.
  template <class Report, class Counting>
  void run(Report&& report, const Counting& counting) {
    for (unsigned slot = 0; slot < in_flight_; ++slot) start(slot, report);
    while (counts_[0] | counts_[1]) {
      counting.node_queue(counts_[0]);
      step_nodes();
      counting.leaf_queue(counts_[1]);
      step_leaves();
      const unsigned done = std::exchange(counts_[2], 0u);
      for (unsigned i = 0; i < done; ++i) {
        const unsigned slot = queues_[2][i].slot;
        State& s = state(slot);
        if constexpr (!AnyHit) leaves_.finish(s.data, s.best);
        report(s.index, s.best);
        start(slot, report);
      }
    }
  }

 private:
  static constexpr int W = lanes_for(N);
  /// Of a stack: kDone at its bottom, and what push() writes beyond the top.
  static constexpr std::size_t kSpareEntries = 6;
  using F = vf<W>;
  using Box = BoxRay<N, Padded>;

  struct alignas(64) State {
    Box box;
    float first;  ///< distance from which boxes count
    float tnear;
    StackEntry* top;
    NearestHit best;
    std::size_t index;
    typename Leaves::RayData data;

    ARBORETUM_INLINE State(const Ray& ray, const Leaves& leaves, float max_coordinate, StackEntry* stack, std::size_t i)
        : box(ray, max_coordinate), first(first_distance(ray)), tnear(ray.tnear), top(stack), best{ray.tfar}, index(i),
          data(leaves.prepare(ray)) {}
  };
  struct Step {
    std::uint32_t slot;
    bvh::NodeReference target;
  };

  State& state(unsigned slot) { return *reinterpret_cast<State*>(states_ + slot * sizeof(State)); }

  /// The ends of the queues while a loop appends to them: in registers.
  struct Tails {
    Queued& q;
    unsigned node, leaf, done;
    ARBORETUM_INLINE explicit Tails(Queued& queued)
        : q(queued), node(queued.counts_[0]), leaf(queued.counts_[1]), done(queued.counts_[2]) {}
    ARBORETUM_INLINE ~Tails() { q.counts_[0] = node, q.counts_[1] = leaf, q.counts_[2] = done; }

    /// Asks for the lines of the target and puts the step on the queue of its kind.
    ARBORETUM_INLINE void route(unsigned slot, bvh::NodeReference target) {
      prefetch_lines<lines_of(std::max(sizeof(bvh::Node<N>), Leaves::kBytesAhead))>(q.base_ + bvh::offset_of(target));
      const Step step{slot, target};
      const unsigned kind = kind_of(target);
      q.queues_[0][node] = step, q.queues_[1][leaf] = step, q.queues_[2][done] = step;
      node += kind == 0, leaf += kind == 1, done += kind == 2;
    }
  };

  template <class Report>
  void start(unsigned slot, Report&& report) {
    for (; next_ < rays_.size(); ++next_) {
      const Ray& ray = rays_[next_];
      if (!is_valid_in_lanes(ray)) {
        report(next_, NearestHit{ray.tfar});
        continue;
      }
      StackEntry* const stack = stacks_.data() + slot * stride_;
      stack[0] = kDone;
      new (&state(slot)) State(ray, leaves_, max_coordinate_, stack + 1, next_++);
      Tails(*this).route(slot, root_);
      return;
    }
  }

  static ARBORETUM_INLINE bvh::NodeReference pop(State& s) { return bvh::NodeReference(*--s.top); }

  /// Drops what starts beyond the nearest hit, so that pop() need not look.
  ARBORETUM_INLINE void drop_far(State& s, unsigned slot) {
    StackEntry* const bottom = stacks_.data() + slot * stride_;
    StackEntry* out = bottom;
    for (const StackEntry* e = bottom; e != s.top; ++e) {
      *out = *e;
      out += __builtin_bit_cast(float, std::uint32_t(*e >> 32)) <= s.best.t;
    }
    s.top = out;
  }

  void step_nodes() {
    const unsigned count = std::exchange(counts_[0], 0u);
    Step steps[kMostInFlight];
    std::memcpy(steps, queues_[0], count * sizeof(Step));
    Tails tails(*this);
    for (unsigned i = 0; i < count; ++i) {
      State& s = state(steps[i].slot);
      const std::byte* node = base_ + bvh::offset_of(steps[i].target);
      F entry;
      const unsigned hit = BoxLanes<N, Padded>(s.box).test(node, F(s.first), F(s.best.t), entry);
      push<N, AnyHit>(reinterpret_cast<const bvh::NodeReference*>(node + 6 * N * sizeof(float)), entry, hit, s.top);
      tails.route(steps[i].slot, pop(s));
    }
  }

  void step_leaves() {
    const unsigned count = std::exchange(counts_[1], 0u);
    for (unsigned i = 0; i < count; ++i) {
      const Step step = queues_[1][i];
      State& s = state(step.slot);
      const std::byte* const blocks = base_ + bvh::offset_of(step.target);
      const unsigned blocks_in_leaf = bvh::block_count(step.target);
      if constexpr (AnyHit) {
        if (leaves_.any_hit(s.data, blocks, blocks_in_leaf, s.tnear, s.best.t)) {
          s.best.primitive = 0;
          s.top = stacks_.data() + step.slot * stride_ + 1;
        }
      } else if (leaves_.closest_hit(s.data, blocks, blocks_in_leaf, s.tnear, s.best)) {
        drop_far(s, step.slot);
      }
      // Only nodes and ends come back to this queue's place: the steps before i are spent.
      pending_[i] = {step.slot, pop(s)};
    }
    Tails tails(*this);
    for (unsigned i = 0; i < count; ++i) tails.route(pending_[i].slot, pending_[i].target);
  }

  const unsigned in_flight_;
  const std::byte* base_;
  const Leaves leaves_;
  const bvh::NodeReference root_;
  const float max_coordinate_;
  const RayBatch rays_;
  std::size_t next_ = 0;
  const std::size_t stride_;
  std::vector<StackEntry> stacks_;
  unsigned counts_[3] = {0, 0, 0};
  Step queues_[3][kMostInFlight + 1];  ///< one place more: a step is written to the end of all three
  Step pending_[kMostInFlight];
  alignas(64) std::byte states_[kMostInFlight * sizeof(State)];
};

/// As traversal/queued_functions.h takes it.
template <int N>
struct BvhQueue {
  template <class Leaves, bool Padded, bool AnyHit>
  using Of = Queued<N, Leaves, Padded, AnyHit>;
  using Single = typename BvhSingle<SoaTests<N>::template Nodes>::Functions;
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
