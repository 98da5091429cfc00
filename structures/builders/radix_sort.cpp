#include "structures/builders/radix_sort.h"

#include <algorithm>
#include <array>

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

namespace arboretum {
namespace {

constexpr unsigned kDigitBits = 11;  // 2048 open cache lines fit the second-level cache
constexpr std::size_t kDigits = 1u << kDigitBits;
constexpr std::size_t kSmall = 1u << 9;
constexpr std::size_t kLeastChunk = 1u << 14;

using Histogram = std::array<std::uint32_t, kDigits>;

}  // namespace

void radix_sort(MeteredVector<std::uint64_t>& keys, unsigned low, unsigned high) {
  const std::size_t n = keys.size();
  if (n < 2 || low >= high) return;
  if (n < kSmall) {
    const std::uint64_t mask = (high < 64 ? (std::uint64_t{1} << high) : 0) - (std::uint64_t{1} << low);
    std::ranges::stable_sort(keys, {}, [mask](std::uint64_t key) { return key & mask; });
    return;
  }
  // A stable sort has one result, however the work is cut: the chunks may follow the number of threads.
  const auto threads = std::size_t(std::max(1, tbb::this_task_arena::max_concurrency()));
  const std::size_t chunks = threads == 1 ? 1 : std::clamp<std::size_t>(n / kLeastChunk, 1, 4 * threads);
  const auto chunk_begin = [&](std::size_t c) { return n * c / chunks; };
  MeteredVector<Histogram> counts(chunks);
  MeteredVector<std::uint64_t> other(n);
  const unsigned passes = (high - low + kDigitBits - 1) / kDigitBits;
  for (unsigned pass = 0; pass < passes; ++pass) {
    const unsigned shift = low + (high - low) * pass / passes, end = low + (high - low) * (pass + 1) / passes;
    const auto mask = std::uint32_t((1u << (end - shift)) - 1);
    const auto digit = [shift, mask](std::uint64_t key) { return std::uint32_t(key >> shift) & mask; };
    tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t c) {
      Histogram& count = counts[c];
      count.fill(0);
      for (const std::uint64_t *k = keys.data() + chunk_begin(c), *last = keys.data() + chunk_begin(c + 1); k < last;
           ++k)
        ++count[digit(*k)];
    });
    std::uint32_t next = 0;
    bool one_digit = false;
    for (std::size_t d = 0; d <= mask; ++d) {
      const std::uint32_t before = next;
      for (Histogram& count : counts) next += std::exchange(count[d], next);
      one_digit |= next - before == n;
    }
    if (one_digit) continue;
    tbb::parallel_for(std::size_t{0}, chunks, [&](std::size_t c) {
      Histogram& target = counts[c];
      for (const std::uint64_t *k = keys.data() + chunk_begin(c), *last = keys.data() + chunk_begin(c + 1); k < last;
           ++k) {
        other[target[digit(*k)]++] = *k;
      }
    });
    keys.swap(other);
  }
}

}  // namespace arboretum
