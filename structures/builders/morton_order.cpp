#include "structures/builders/morton_order.h"

#include <algorithm>
#include <atomic>
#include <bit>
#include <string>

#include <tbb/parallel_for.h>

#include "core/error.h"
#include "core/morton.h"
#include "structures/builders/box4.h"
#include "structures/builders/radix_sort.h"

namespace arboretum {
namespace {

constexpr std::size_t kChunk = 1u << 14;
constexpr unsigned kRestBits = 31;
constexpr std::size_t kShortRun = 8;  ///< triangles that may share the upper bits and keep their order: a leaf or two

template <class F>
void for_chunks(std::size_t n, const F& f) {
  tbb::parallel_for(std::size_t{0}, (n + kChunk - 1) / kChunk, [&](std::size_t c) { f(c, c * kChunk, std::min(n, (c + 1) * kChunk)); });
}

/// Cells of a cube around the centroids: cells as wide on each axis make better boxes than the scene's own proportions.
class Cells {
 public:
  Cells(const Box4& centroids, unsigned bits_an_axis) : lower_(centroids.lower), last_(_mm_set1_ps(float((1u << bits_an_axis) - 1))) {
    const Vec3f extent = to_vec3f(_mm_sub_ps(centroids.upper, centroids.lower));
    const float largest = std::max({extent.x, extent.y, extent.z});
    scale_ = _mm_set1_ps(largest > 1e-30f ? float(1u << bits_an_axis) / largest : 0.0f);
  }
  /// A NaN, as where coordinates overflow, counts as 0.
  [[nodiscard]] std::uint64_t code(__m128 c) const noexcept {
    const __m128 at = _mm_mul_ps(_mm_sub_ps(c, lower_), scale_);
    alignas(16) std::uint32_t cell[4];
    _mm_store_si128(reinterpret_cast<__m128i*>(cell), _mm_cvttps_epi32(_mm_min_ps(_mm_max_ps(at, _mm_setzero_ps()), last_)));
    return morton_code(cell[0], cell[1], cell[2]);
  }

 private:
  __m128 lower_, last_, scale_;
};

}  // namespace

void check_morton_bits(unsigned bits) {
  if (bits != 30 && bits != 63) throw UserError("morton_bits: " + std::to_string(bits) + " is neither 30 nor 63");
}

MortonOrder::MortonOrder(const TriangleMesh& mesh, unsigned bits) : keys_(mesh.size()) {
  check_morton_bits(bits);
  const std::size_t n = mesh.size();
  if (n == 0) return;
  struct alignas(16) Centroid {
    float doubled[4];
  };
  MeteredVector<Centroid> centroids(n);
  MeteredVector<Box4> partial((n + kChunk - 1) / kChunk);
  const TriangleBoxes boxes(mesh);
  for_chunks(n, [&](std::size_t c, std::size_t begin, std::size_t end) {
    Box4 all;
    for (std::size_t i = begin; i < end; ++i) {
      const Box4 box = boxes.box(i);
      const __m128 doubled = _mm_add_ps(box.lower, box.upper);
      _mm_store_ps(centroids[i].doubled, doubled);
      all.extend(doubled);
    }
    partial[c] = all;
  });
  Box4 box;
  for (const Box4& b : partial) box.extend(b);
  const Cells cells(box, bits / 3);
  const unsigned left_out = bits == 30 ? 0 : kRestBits;
  const auto code = [&](std::size_t i) { return cells.code(_mm_load_ps(centroids[i].doubled)); };
  for_chunks(n, [&](std::size_t, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) keys_[i] = code(i) >> left_out << 32 | i;
  });
  radix_sort(keys_, 32, bits == 30 ? 62 : 64);
  if (bits == 63) refine([&](std::uint32_t i) { return std::uint32_t(code(i)) & ((1u << kRestBits) - 1); });
}

/// Calls f(begin, end) for the runs of keys with the same upper half that begin in a chunk.
template <class F>
void MortonOrder::for_runs(const F& f) const {
  const std::size_t n = keys_.size();
  const auto upper = [&](std::size_t i) { return keys_[i] >> 32; };
  for_chunks(n, [&](std::size_t, std::size_t begin, std::size_t end) {
    if (begin > 0) {
      while (begin < end && upper(begin) == upper(begin - 1)) ++begin;
    }
    while (begin < end) {
      std::size_t last = begin + 1;
      while (last < n && upper(last) == upper(begin)) ++last;
      f(begin, last);
      begin = last;
    }
  });
}

/// Sorts long runs of keys with the same upper half by the lower; each is done with the chunk that it begins in.
template <class Rest>
void MortonOrder::refine(const Rest& rest) {
  std::atomic<bool> any{false};
  for_runs([&](std::size_t begin, std::size_t end) {
    if (end - begin > kShortRun) any.store(true, std::memory_order_relaxed);
  });
  if (!any) return;
  rest_.resize(keys_.size());
  // Upper halves stay where they are, so that a chunk may look at its neighbours' while these are sorted.
  for_runs([&](std::size_t begin, std::size_t end) {
    if (end - begin <= kShortRun) {
      std::fill(rest_.begin() + std::ptrdiff_t(begin), rest_.begin() + std::ptrdiff_t(end), 0u);
      return;
    }
    MeteredVector<std::uint64_t> run(end - begin);
    const std::uint64_t high = keys_[begin] >> 32 << 32;
    for (std::size_t i = begin; i < end; ++i) run[i - begin] = std::uint64_t{rest(id(i))} << 32 | id(i);
    if (run.size() < kChunk) {
      std::sort(run.begin(), run.end());
    } else {
      radix_sort(run, 32, 32 + kRestBits);
    }
    for (std::size_t i = begin; i < end; ++i) keys_[i] = high | std::uint32_t(run[i - begin]), rest_[i] = std::uint32_t(run[i - begin] >> 32);
  });
}

template <class Code>
std::size_t MortonOrder::split_at_bit(std::size_t begin, std::size_t end, const Code& code) noexcept {
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

std::size_t MortonOrder::split(std::size_t begin, std::size_t end) const noexcept {
  if (keys_[begin] >> 32 != keys_[end - 1] >> 32) {
    return split_at_bit(begin, end, [this](std::size_t i) { return std::uint32_t(keys_[i] >> 32); });
  }
  if (rest_.empty() || rest_[begin] == rest_[end - 1]) return begin + (end - begin) / 2;
  return split_at_bit(begin, end, [this](std::size_t i) { return rest_[i]; });
}

}  // namespace arboretum
