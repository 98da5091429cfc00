// Many rays in flight through a wide BVH of any node format (traversal/queued_rays.h).
//
// The steps of bvh_single.h, one at a time: children in the same order, nearest on top of the ray's own stack; for any
// hit as they stand in the node. A reference's own bits tell the kind of a step, the end of a stack is a reference too,
// and what starts beyond a new hit leaves the stack when that is found: a step takes the top, compares nothing and has
// no branch but those of its test.
#pragma once

#include "simd/lane_order.h"
#include "traversal/usual_leaves.h"
#include "structures/bvh/bvh_single.h"
#include "traversal/queued_rays.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// Marks the end of a ray's stack: neither a node nor a leaf.
inline constexpr bvh::NodeReference kDone = 16;

/// The kinds of step, as the reference's own bits tell them: node 0, leaf 1, done 2.
[[nodiscard]] ARBORETUM_INLINE unsigned kind_of(bvh::NodeReference r) { return r >> 3 & 3u; }

/// The children of `hit`, whose references lie `Stride` places apart, onto the stack, the nearest on top: the order of
/// push_children(). For any hit as they stand in the node: walk_bvh()'s.
template <int Stride, bool AnyHit>
ARBORETUM_INLINE void push_in_scalars(const bvh::NodeReference* child, const std::uint32_t* key, unsigned hit,
                                      StackEntry*& top) {
  for (StackEntry* const bottom = top; hit; hit &= hit - 1) {
    const int i = __builtin_ctz(hit);
    const StackEntry e = stack_entry(key[i], child[i * Stride]);
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

/// The same as push_in_scalars(): up to four children, the usual case, without a branch where the registers can do it.
/// Writes up to four entries whatever their number.
template <int Stride, bool AnyHit, int W>
ARBORETUM_INLINE void push(const bvh::NodeReference* child, vf<W> entry, unsigned hit, StackEntry*& top) {
  [[maybe_unused]] const unsigned count = unsigned(__builtin_popcount(hit));
#if ARBORETUM_TARGET >= ARBORETUM_TARGET_AVX2
  if constexpr (kOrdersLanes<W>) {
    if (W == 4 || __builtin_expect(count <= 4, 1)) {
      push_four<AnyHit>(references<Stride, W>(child), entry, hit, top);
      top += count;
      return;
    }
  }
#elif ARBORETUM_TARGET == ARBORETUM_TARGET_SSE
  if constexpr (W == 4 || W == 8) {
    if (W == 4 || __builtin_expect(count <= 4, 1)) {
      __m128i keys, in_order;
      const __m128i from = _mm_load_si128(reinterpret_cast<const __m128i*>(kCompressBytes.bytes[hit]));
      const vi<W> all = references<Stride, W>(child);
      if constexpr (W == 4) {
        in_order = _mm_shuffle_epi8(all.v, from);
        keys = _mm_shuffle_epi8(_mm_castps_si128(entry.v), from);
      } else {
        in_order = compress_bytes(all.lo.v, all.hi.v, from);
        keys = compress_bytes(_mm_castps_si128(entry.lo.v), _mm_castps_si128(entry.hi.v), from);
      }
      __m128d a = _mm_castsi128_pd(_mm_unpacklo_epi32(in_order, keys)),
              b = _mm_castsi128_pd(_mm_unpackhi_epi32(in_order, keys));
      if constexpr (!AnyHit) sort_down(a, b);
      _mm_storeu_pd(reinterpret_cast<double*>(top), a), _mm_storeu_pd(reinterpret_cast<double*>(top + 2), b);
      top += count;
      return;
    }
  }
#endif
  alignas(64) std::uint32_t key[W];
  entry.store(key);
  push_in_scalars<Stride, AnyHit>(child, key, hit, top);
}

/// `Nodes`: a ray and how it meets nodes, as bvh_single.h says.
template <class Nodes, class Leaves, bool AnyHit>
class BvhNodeWalk {
 public:
  static constexpr bool kAnyHit = AnyHit;
  using Target = bvh::NodeReference;
  using Entry = StackEntry;
  struct State {
    Nodes nodes;
    typename Leaves::RayData data;
    Entry* top;
    float tnear;
    NearestHit best;
  };

  BvhNodeWalk(const Accel& accel, const KernelRow& row) : BvhNodeWalk(static_cast<const bvh::BvhBase&>(accel), row) {}

  /// Beside what waits: the end at the bottom, and what push() writes beyond the top.
  std::size_t stack_entries() const { return stack_entries_ + kSpareEntries; }

  ARBORETUM_INLINE void start(void* state, const Ray& ray, float time, Entry* stack) const {
    stack[0] = kDone;
    new (state) State{nodes_at<Nodes>(ray, max_coordinate_, time), prepare_at(leaves_, ray, time), stack + 1, ray.tnear,
                      NearestHit{ray.tfar}};
  }
  ARBORETUM_INLINE Target first(const State&) const { return root_; }
  static ARBORETUM_INLINE unsigned kind(Target target) { return kind_of(target); }

  ARBORETUM_INLINE void prefetch(Target target) const {
    prefetch_lines<lines_of(std::max(Nodes::kBytes, Leaves::kBytesAhead))>(base_ + bvh::offset_of(target));
  }

  ARBORETUM_INLINE Target node(State& s, Target target) const {
    const std::byte* const node = base_ + bvh::offset_of(target);
    vf<Nodes::W> entry;
    const unsigned hit = s.nodes.test(node, entry);
    push<Nodes::kStride, AnyHit>(Nodes::children(node), entry, hit, s.top);
    return pop(s);
  }

  ARBORETUM_INLINE Target leaf(State& s, Target target, Entry* stack) const {
    const std::byte* const blocks = base_ + bvh::offset_of(target);
    const unsigned count = bvh::block_count(target);
    if constexpr (AnyHit) {
      if (leaves_.any_hit(s.data, blocks, count, s.tnear, s.best.t)) s.best.primitive = 0, s.top = stack + 1;
    } else if (leaves_.closest_hit(s.data, blocks, count, s.tnear, s.best)) {
      s.nodes.shorten(s.best.t);
      Entry* out = stack + 1;
      for (const Entry* e = out; e != s.top; ++e) {
        *out = *e;
        out += __builtin_bit_cast(float, std::uint32_t(*e >> 32)) <= s.best.t;
      }
      s.top = out;
    }
    return pop(s);
  }

  ARBORETUM_INLINE void finish(State& s) const {
    if constexpr (!AnyHit) leaves_.finish(s.data, s.best);
  }

 private:
  BvhNodeWalk(const bvh::BvhBase& tree, const KernelRow& row)
      : base_(tree.base()), root_(tree.root()), max_coordinate_(tree.max_coordinate()),
        leaves_(leaves_of<Leaves>(tree, row)), stack_entries_(tree.stack_entries()) {}

  static constexpr std::size_t kSpareEntries = 6;

  static ARBORETUM_INLINE Target pop(State& s) { return Target(*--s.top); }

  const std::byte* base_;
  bvh::NodeReference root_;
  float max_coordinate_;
  Leaves leaves_;
  std::size_t stack_entries_;
};

/// As traversal/queued_functions.h takes it, for nodes that `Nodes<Padded>` tests.
template <template <bool> class Nodes>
struct BvhNodeQueue {
  template <class Leaves, bool Padded, bool AnyHit>
  using Of = QueuedRays<BvhNodeWalk<Nodes<Padded>, Leaves, AnyHit>>;
};

/// Of a ray its constants alone are kept, from which a step makes its `Test` of nodes (bvh_single.h) anew, in
/// registers.
template <class Test, int N, bool Padded>
struct NodeConstants {
  static constexpr int W = Test::W, kStride = Test::kStride;
  static constexpr std::size_t kBytes = Test::kBytes;
  BoxRay<N, Padded> box;
  float first, last;

  ARBORETUM_INLINE NodeConstants(const Ray& ray, float max_coordinate)
      : box(ray, max_coordinate), first(first_distance(ray)), last(ray.tfar) {}
  ARBORETUM_INLINE unsigned test(const std::byte* node, vf<W>& entry) const {
    return Test(box, first, last).test(node, entry);
  }
  ARBORETUM_INLINE void shorten(float t) { last = t; }
  static ARBORETUM_INLINE const bvh::NodeReference* children(const std::byte* node) { return Test::children(node); }
};
template <int N>
struct SoaConstants {
  template <bool Padded>
  using Nodes = NodeConstants<SoaNodeTest<N, Padded>, N, Padded>;
};

/// Of the wide BVHs.
template <int N>
struct BvhQueue : BvhNodeQueue<SoaConstants<N>::template Nodes> {
  using Single = typename BvhSingle<SoaTests<N>::template Nodes>::Functions;
};

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
