#include "structures/builders/morton_order.h"

#include <algorithm>
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

template <class F>
void for_chunks(std::size_t n, const F& f) {
  tbb::parallel_for(std::size_t{0}, (n + kChunk - 1) / kChunk, [&](std::size_t c) { f(c, c * kChunk, std::min(n, (c + 1) * kChunk)); });
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
      const __m128 v = vertices[std::uint32_t(i)], nought = _mm_mul_ps(v, zero);  // 0, or NaN where not finite: then the other operand counts
      all.lower = _mm_min_ps(_mm_add_ps(v, nought), all.lower), all.upper = _mm_max_ps(_mm_add_ps(v, nought), all.upper);
    }
    partial[c] = all;
  });
  Box4 all;
  for (const Box4& b : partial) all.extend(b);
  return {_mm_add_ps(all.lower, all.lower), _mm_add_ps(all.upper, all.upper)};
}

}  // namespace

MortonCells::MortonCells(const Box4& points, unsigned bits)
    : lower_(points.lower), last_(_mm_set1_ps(float((1u << bits / 3) - 1))), fine_bits_(int(bits / 3) - 10) {
  const float largest = largest_extent(points);
  scale_ = _mm_set1_ps(largest > 1e-30f ? float(1u << bits / 3) / largest : 0.0f);
}

std::uint64_t MortonCells::code(__m128 point) const noexcept {
  alignas(16) std::uint32_t c[4];
  _mm_store_si128(reinterpret_cast<__m128i*>(c), number(point, lower_, scale_, last_));
  return morton_code(c[0], c[1], c[2]);
}

__m128i MortonCells::first_bits(const __m128 (&point)[4]) const noexcept {
  const Points4 p(point[0], point[1], point[2], point[3]);
  const auto axis = [this](__m128 at, __m128 lower) {
    __m128i v = _mm_srl_epi32(number(at, lower, scale_, last_), _mm_cvtsi32_si128(fine_bits_));
    const auto spread = [&v](int by, int mask) { v = _mm_and_si128(_mm_or_si128(v, _mm_slli_epi32(v, by)), _mm_set1_epi32(mask)); };
    spread(16, 0x030000ff), spread(8, 0x0300f00f), spread(4, 0x030c30c3), spread(2, 0x09249249);  // as spread_bits()
    return v;
  };
  const __m128i x = axis(p.x, _mm_shuffle_ps(lower_, lower_, 0x00)), y = axis(p.y, _mm_shuffle_ps(lower_, lower_, 0x55)),
                z = axis(p.z, _mm_shuffle_ps(lower_, lower_, 0xaa));
  return _mm_or_si128(_mm_or_si128(_mm_slli_epi32(x, 2), _mm_slli_epi32(y, 1)), z);
}

void check_morton_bits(unsigned bits) {
  if (bits != 30 && bits != 63) throw UserError("morton_bits: " + std::to_string(bits) + " is neither 30 nor 63");
}

MortonOrder::MortonOrder(const TriangleMesh& mesh, unsigned bits, unsigned sorted) : boxes_(mesh), bits_(bits), sorted_(sorted), keys_(mesh.size()) {
  check_morton_bits(bits);
  const std::size_t n = mesh.size();
  if (n == 0) return;
  // The vertices' bounds are had sooner than the centroids', and as good, unless vertices that no triangle has lie far out.
  const Box4 guess = doubled_vertex_bounds(mesh);
  cells_ = MortonCells(guess, bits);
  const Box4 centroids = make_keys();
  if (largest_extent(centroids) < 0.5f * largest_extent(guess)) {
    cells_ = MortonCells(centroids, bits);
    make_keys();
  }
  radix_sort(keys_, 32, 32 + sorted);
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
    const __m128i left_out = _mm_cvtsi32_si128(int(kAtOnce - sorted_));
    std::size_t i = begin;
    for (; i + 4 <= end; i += 4) {
      const __m128i code = _mm_srl_epi32(cells.first_bits({centroid(i), centroid(i + 1), centroid(i + 2), centroid(i + 3)}), left_out);
      const __m128i id = _mm_add_epi32(_mm_set1_epi32(int(i)), _mm_setr_epi32(0, 1, 2, 3));
      _mm_storeu_si128(reinterpret_cast<__m128i*>(&keys_[i]), _mm_unpacklo_epi32(id, code));
      _mm_storeu_si128(reinterpret_cast<__m128i*>(&keys_[i + 2]), _mm_unpackhi_epi32(id, code));
    }
    for (; i < end; ++i) keys_[i] = cells.code(centroid(i)) >> (bits_ - sorted_) << 32 | i;
    partial[c] = all;
  });
  Box4 all;
  for (const Box4& b : partial) all.extend(b);
  return all;
}

unsigned MortonOrder::refine(std::size_t begin, std::size_t end, unsigned sorted) {
  const unsigned more = std::min(bits_ - sorted, kAtOnce);
  const auto next_bits = [&](std::uint32_t triangle) {
    return cells_.code(doubled_centroid(boxes_.box(triangle))) >> (bits_ - sorted - more) & ((std::uint64_t{1} << more) - 1);
  };
  const auto put = [&](std::size_t i) { keys_[i] = next_bits(id(i)) << 32 | id(i); };
  const auto first = keys_.begin() + std::ptrdiff_t(begin), last = keys_.begin() + std::ptrdiff_t(end);
  if (end - begin < kChunk) {
    for (std::size_t i = begin; i < end; ++i) put(i);
    std::sort(first, last);
  } else {
    for_chunks(end - begin, [&](std::size_t, std::size_t b, std::size_t e) {
      for (std::size_t i = b; i < e; ++i) put(begin + i);
    });
    MeteredVector<std::uint64_t> run(first, last);
    radix_sort(run, 32, 32 + more);
    std::copy(run.begin(), run.end(), first);
  }
  return sorted + more;
}

void MortonOrder::refine_runs(std::size_t longest) { refine_runs(0, size(), longest, sorted_); }

void MortonOrder::refine_runs(std::size_t begin, std::size_t end, std::size_t longest, unsigned sorted) {
  if (sorted == bits_) return;
  std::vector<std::pair<std::size_t, std::size_t>> runs;
  for (std::size_t i = begin; i < end;) {
    const std::size_t first = i;
    while (i < end && code(i) == code(first)) ++i;
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
  const std::uint32_t bit = std::bit_floor(code(begin) ^ code(end - 1));
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
  std::uint32_t most = 0;
  for (std::size_t full = begin + width; full < begin + blocks * width; full += width) {
    for (std::size_t i = full - to_spare; i <= full; ++i) {
      const std::uint32_t change = code(i - 1) ^ code(i);
      if (change > most) most = change, best = i;
    }
  }
  return best;
}

}  // namespace arboretum
