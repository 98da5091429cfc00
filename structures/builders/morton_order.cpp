#include "structures/builders/morton_order.h"

#include <algorithm>
#include <array>
#include <bit>
#include <string>
#include <utility>
#include <vector>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/morton.h"
#include "structures/builders/radix_sort.h"

namespace arboretum {
namespace {

constexpr std::size_t kChunk = 1u << 14;
constexpr std::size_t kFew = 2048, kVeryFew = 24;  ///< keys that are sorted by small digits; by comparison
constexpr unsigned kMostDigitBits = 8;             ///< of a small digit

template <class F>
void for_chunks(std::size_t n, const F& f) {
  tbb::parallel_for(std::size_t{0}, (n + kChunk - 1) / kChunk,
                    [&](std::size_t c) { f(c, c * kChunk, std::min(n, (c + 1) * kChunk)); });
}

__m128 doubled_centroid(const Box4& box) noexcept { return _mm_add_ps(box.lower, box.upper); }

float largest_extent(const Box4& box) noexcept {
  const Vec3f extent = to_vec3f(_mm_sub_ps(box.upper, box.lower));
  return std::max({extent.x, extent.y, extent.z});
}

/// Bounds of all vertices that are finite, doubled as centroids are. Some of them may be no triangle's.
Box4 doubled_vertex_bounds(const TriangleMesh& mesh) {
  const std::size_t n = mesh.vertices.size();
  const TriangleVertices vertices(mesh);
  std::vector<Box4> partial((n + kChunk - 1) / kChunk);
  for_chunks(n, [&](std::size_t c, std::size_t begin, std::size_t end) {
    Box4 all;
    const __m128 zero = _mm_setzero_ps();
    for (std::size_t i = begin; i < end; ++i) {
      // 0, or NaN where not finite: then the other operand counts
      const __m128 v = vertices[std::uint32_t(i)], nought = _mm_mul_ps(v, zero);
      all.lower = _mm_min_ps(_mm_add_ps(v, nought), all.lower),
      all.upper = _mm_max_ps(_mm_add_ps(v, nought), all.upper);
    }
    partial[c] = all;
  });
  Box4 all;
  for (const Box4& b : partial) all.extend(b);
  return {_mm_add_ps(all.lower, all.lower), _mm_add_ps(all.upper, all.upper)};
}

/// Sorts n keys by `bits` above the `low` lowest, by digits that suit a few hundred, or very few by all bits; what
/// stands above is the same for all. They are then in `keys` or `room`: where is returned.
std::uint64_t* sort_few(std::uint64_t* keys, std::uint64_t* room, std::size_t n, unsigned low, unsigned bits) noexcept {
  if (n <= kVeryFew) {
    std::sort(keys, keys + n);
    return keys;
  }
  const unsigned most = std::clamp(unsigned(std::bit_width(n)), 6u, kMostDigitBits), passes = (bits + most - 1) / most;
  for (unsigned pass = 0; pass < passes; ++pass) {
    const unsigned shift = low + bits * pass / passes, digit_bits = low + bits * (pass + 1) / passes - shift;
    const std::uint64_t mask = (std::uint64_t{1} << digit_bits) - 1;
    std::uint32_t place[1u << kMostDigitBits];
    std::fill_n(place, mask + 1, 0u);
    for (std::size_t i = 0; i < n; ++i) ++place[keys[i] >> shift & mask];
    std::uint32_t next = 0;
    for (std::size_t d = 0; d <= mask; ++d) next += std::exchange(place[d], next);
    for (std::size_t i = 0; i < n; ++i) room[place[keys[i] >> shift & mask]++] = keys[i];
    std::swap(keys, room);
  }
  return keys;
}

}  // namespace

MortonCells::MortonCells(const Box4& points, unsigned bits)
    : lower_(points.lower), last_(_mm_set1_ps(float((1u << bits / 3) - 1))), axis_bits_(bits / 3) {
  const float largest = largest_extent(points);
  scale_ = _mm_set1_ps(largest > 1e-30f ? float(1u << bits / 3) / largest : 0.0f);
}

std::uint64_t MortonCells::code(__m128 point) const noexcept {
  alignas(16) std::uint32_t c[4];
  _mm_store_si128(reinterpret_cast<__m128i*>(c), number(point, lower_, scale_, last_));
  return morton_code(c[0], c[1], c[2]);
}

__attribute__((always_inline)) inline void MortonCells::put_keys(const __m128 (&point)[4], __m128i id, unsigned id_bits,
                                                                 unsigned skipped, unsigned count,
                                                                 std::uint64_t* keys) const noexcept {
  const Points4 p(point[0], point[1], point[2], point[3]);
  const auto number_of = [this](__m128 at, __m128 lower) { return number(at, lower, scale_, last_); };
  const __m128i x = number_of(p.x, _mm_shuffle_ps(lower_, lower_, 0x00)),
                y = number_of(p.y, _mm_shuffle_ps(lower_, lower_, 0x55)),
                z = number_of(p.z, _mm_shuffle_ps(lower_, lower_, 0xaa));
  const auto bits_of_codes = [&](unsigned behind, unsigned bits) {
    const __m128i shift = _mm_cvtsi32_si128(int(axis_bits_ - (behind + bits) / 3)),
                  mask = _mm_set1_epi32((1 << bits / 3) - 1);
    const auto axis = [&](__m128i v) {
      v = _mm_and_si128(_mm_srl_epi32(v, shift), mask);
      const auto spread = [&v](int by, int kept) {
        v = _mm_and_si128(_mm_or_si128(v, _mm_slli_epi32(v, by)), _mm_set1_epi32(kept));
      };
      if (bits > 24) spread(16, 0x030000ff);  // as spread_bits()
      if (bits > 12) spread(8, 0x0300f00f);
      spread(4, 0x030c30c3), spread(2, 0x09249249);
      return v;
    };
    return _mm_or_si128(_mm_or_si128(_mm_slli_epi32(axis(x), 2), _mm_slli_epi32(axis(y), 1)), axis(z));
  };
  // A lane of 32 bits has room for 30.
  const unsigned first = std::min(count, 30u), others = count - first;
  const __m128i high = bits_of_codes(skipped, first), zero = _mm_setzero_si128(),
                low = others > 0 ? bits_of_codes(skipped + first, others) : zero;
  const __m128i above_low = _mm_cvtsi32_si128(int(others)), above_id = _mm_cvtsi32_si128(int(id_bits));
  const auto put = [&](std::uint64_t* to, __m128i its_high, __m128i its_low, __m128i its_id) {
    const __m128i code = _mm_or_si128(_mm_sll_epi64(its_high, above_low), its_low);
    _mm_storeu_si128(reinterpret_cast<__m128i*>(to), _mm_or_si128(_mm_sll_epi64(code, above_id), its_id));
  };
  put(keys, _mm_unpacklo_epi32(high, zero), _mm_unpacklo_epi32(low, zero), _mm_unpacklo_epi32(id, zero));
  put(keys + 2, _mm_unpackhi_epi32(high, zero), _mm_unpackhi_epi32(low, zero), _mm_unpackhi_epi32(id, zero));
}

MortonOrder::MortonOrder(const TriangleMesh& mesh, unsigned bits, unsigned sorted)
    : boxes_(mesh), bits_(bits), sorted_(sorted), id_bits_(unsigned(std::bit_width(mesh.size()))),
      held_(std::min(bits, boxes_.are_far() ? (64 - id_bits_) / 3 * 3 : kAtOnce)), keys_(mesh.size()) {
  const std::size_t n = mesh.size();
  if (n == 0) return;
  // The vertices' bounds are had sooner than the centroids', and as good, unless vertices that no triangle has lie far
  // out.
  const Box4 guess = doubled_vertex_bounds(mesh);
  cells_ = MortonCells(guess, bits);
  const Box4 centroids = make_keys();
  if (largest_extent(centroids) < 0.5f * largest_extent(guess)) {
    cells_ = MortonCells(centroids, bits);
    make_keys();
  }
  radix_sort(keys_, below(sorted), below(0));
}

/// Puts the keys in the triangles' order; returns the bounds of the doubled centroids.
Box4 MortonOrder::make_keys() {
  const std::size_t n = keys_.size();
  std::vector<Box4> partial((n + kChunk - 1) / kChunk);
  for_chunks(n, [&, cells = cells_](std::size_t c, std::size_t begin, std::size_t end) {
    Box4 all;
    const auto centroid = [&](std::size_t i) {
      const __m128 at = doubled_centroid(boxes_.box(i));
      all.extend(at);
      return at;
    };
    std::size_t i = begin;
    for (; i + 4 <= end; i += 4) {
      const __m128i ids = _mm_add_epi32(_mm_set1_epi32(int(i)), _mm_setr_epi32(0, 1, 2, 3));
      cells.put_keys({centroid(i), centroid(i + 1), centroid(i + 2), centroid(i + 3)}, ids, id_bits_, 0, held_,
                     &keys_[i]);
    }
    for (; i < end; ++i) keys_[i] = cells.code(centroid(i)) >> (bits_ - held_) << id_bits_ | i;
    partial[c] = all;
  });
  Box4 all;
  for (const Box4& b : partial) all.extend(b);
  return all;
}

/// Writes the keys of [begin, end) with the bits of their codes behind the first held_.
void MortonOrder::next_codes(std::size_t begin, std::size_t end, std::uint64_t* keys) const noexcept {
  for (std::size_t i = begin; i < end; i += 4, keys += 4) {
    boxes_.prefetch([this](std::size_t k) { return id(k); }, i, i + 4, end - 1);
    std::uint32_t ids[4];
    __m128 centroids[4];
    for (std::size_t k = 0; k < 4; ++k)
      ids[k] = id(std::min(i + k, end - 1)), centroids[k] = doubled_centroid(boxes_.box(ids[k]));
    cells_.put_keys(centroids, _mm_loadu_si128(reinterpret_cast<const __m128i*>(ids)), id_bits_, held_, bits_ - held_,
                    keys);
  }
}

unsigned MortonOrder::refine(std::size_t begin, std::size_t end, unsigned sorted) {
  const std::size_t n = end - begin;
  // A surface of n triangles is in some 2^(2/3 b) of the cells that b bits tell apart; the rest is left for where it is
  // asked for.
  const unsigned enough = 3 * ((unsigned(std::bit_width(n)) + 1) / 2);
  const bool anew = sorted == held_;
  const unsigned now = sorted + std::min((sorted < held_ ? held_ : bits_) - sorted, enough), low = below(now);
  if (n <= kFew) {
    std::array<std::uint64_t, kFew + 3> run, room;
    std::uint64_t* const keys = &keys_[begin];
    std::uint64_t* const from = anew ? run.data() : keys;
    if (anew) next_codes(begin, end, from);
    if (const std::uint64_t* sorted_keys = sort_few(from, room.data(), n, low, now - sorted); sorted_keys != keys)
      std::copy_n(sorted_keys, n, keys);
  } else {
    MeteredVector<std::uint64_t> run((n + 3) / 4 * 4);
    for_chunks(n, [&](std::size_t, std::size_t b, std::size_t e) {
      if (anew) {
        next_codes(begin + b, begin + e, &run[b]);
      } else {
        std::copy(&keys_[begin] + b, &keys_[begin] + e, &run[b]);
      }
    });
    run.resize(n);
    radix_sort(run, low, low + now - sorted);
    for_chunks(n, [&](std::size_t, std::size_t b, std::size_t e) {
      std::copy(run.begin() + std::ptrdiff_t(b), run.begin() + std::ptrdiff_t(e), &keys_[begin] + b);
    });
  }
  return now;
}

void MortonOrder::refine_runs(std::size_t longest) { refine_runs(0, size(), longest, sorted_); }

void MortonOrder::refine_runs(std::size_t begin, std::size_t end, std::size_t longest, unsigned sorted) {
  if (sorted == bits_) return;
  std::vector<std::pair<std::size_t, std::size_t>> runs;
  for (std::size_t i = begin; i < end;) {
    const std::size_t first = i;
    while (i < end && agree(i, first, sorted)) ++i;
    if (i - first > longest) runs.emplace_back(first, i);
  }
  tbb::parallel_for(std::size_t{0}, runs.size(), [&](std::size_t r) {
    const auto [first, last] = runs[r];
    refine_runs(first, last, longest, refine(first, last, sorted));
  });
}

std::size_t MortonOrder::split(std::size_t begin, std::size_t end) const noexcept {
  if (code(begin) == code(end - 1)) return begin + (end - begin) / 2;
  // The first index whose code has the bit: all codes here share what stands above it.
  const std::uint64_t bit = std::bit_floor(code(begin) ^ code(end - 1));
  std::size_t first = begin, count = end - 1 - begin;
  while (count > 0) {
    const std::size_t half = count / 2;
    const bool below = (code(first + half) & bit) == 0;
    first += below ? half + 1 : 0;
    count = below ? count - half - 1 : half;
  }
  return first;
}

std::size_t MortonOrder::split_into_blocks(std::size_t begin, std::size_t end, std::size_t width) const noexcept {
  const std::size_t blocks = (end - begin + width - 1) / width, to_spare = blocks * width - (end - begin);
  std::size_t best = begin + width;
  std::uint64_t most = 0;
  for (std::size_t full = begin + width; full < begin + blocks * width; full += width) {
    for (std::size_t i = full - to_spare; i <= full; ++i) {
      const std::uint64_t change = code(i - 1) ^ code(i);
      const bool more = change > most;
      most = more ? change : most, best = more ? i : best;
    }
  }
  return best;
}

}  // namespace arboretum
