// ObjectSplit: the binned SAH builders' best split of a range of references by their centroids, and the partition that
// makes it. Small ranges are split by one task, large ones in chunks by several, with more bins.
#pragma once

#include "structures/builders/sah_bins.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {
namespace sah {

/// Bins of references [r, end), more than kLarge, in `total`, binned in parallel; `chunks` keeps the bins of each
/// kChunk of them.
inline void bin_range(const Reference* r, const Reference* end, const BinMap& map, ManyBins& total,
                      MeteredVector<ManyBins>& chunks) {
  chunks.resize((std::size_t(end - r) + kChunk - 1) / kChunk);
  tbb::parallel_for(std::size_t{0}, chunks.size(),
                    [&](std::size_t c) { bin(r + c * kChunk, std::min(end, r + (c + 1) * kChunk), map, chunks[c]); });
  clear(total, map.bins);
  for (const ManyBins& b : chunks) merge(total, b, map.bins);
}

/// partition() in parallel: a chunk's bins say where its two sides go.
inline void partition_range(const Reference* r, const Reference* end, const BinMap& map, const Split& split,
                            const MeteredVector<ManyBins>& chunks, Reference* left_out, Reference* right_out,
                            Box& left_centroids, Box& right_centroids) {
  struct Target {
    Reference *left, *right;
    Box left_centroids, right_centroids;
  };
  MeteredVector<Target> targets(chunks.size());
  for (std::size_t c = 0; c < chunks.size(); ++c) {
    targets[c].left = left_out, targets[c].right = right_out;
    std::size_t to_left = 0;
    for (unsigned b = 0; b < split.bin; ++b) to_left += std::size_t(chunks[c].bin[b].count[split.axis]);
    left_out += to_left, right_out += std::min<std::size_t>(kChunk, std::size_t(end - r) - c * kChunk) - to_left;
  }
  tbb::parallel_for(std::size_t{0}, chunks.size(), [&](std::size_t c) {
    Target& t = targets[c];
    partition(r + c * kChunk, std::min(end, r + (c + 1) * kChunk), map, split, t.left, t.right, t.left_centroids,
              t.right_centroids);
  });
  left_centroids = right_centroids = empty_box();
  for (const Target& t : targets) {
    left_centroids = max_x86(t.left_centroids, left_centroids),
    right_centroids = max_x86(t.right_centroids, right_centroids);
  }
}

/// Brings references [r, r + n) to their sides of a split, the first `left_count` to the left: in two passes, which
/// find what stands on the wrong side, chunk by chunk of either side, and exchange the k-th such reference of the left
/// with the k-th of the right. Which is exchanged with which does not depend on the number of threads.
inline void partition_in_place(Reference* r, std::size_t left_count, std::size_t n, const BinMap& map,
                               const Split& split, Box& left_centroids, Box& right_centroids) {
  struct Chunk {
    std::size_t begin, misplaced, before;  ///< before: misplaced ones in the chunks of the same side in front of it
    Box left_centroids, right_centroids;
  };
  static_assert(kChunk <= std::size_t{1} << 16);
  const std::size_t left_chunks = (left_count + kChunk - 1) / kChunk,
                    right_chunks = (n - left_count + kChunk - 1) / kChunk;
  const auto for_each = [n](std::size_t count, const auto& f) {
    if (n > kLarge) return tbb::parallel_for(std::size_t{0}, count, f);
    for (std::size_t c = 0; c < count; ++c) f(c);
  };
  MeteredVector<Chunk> chunks(left_chunks + right_chunks);
  MeteredVector<std::uint16_t> places(n);  // of a chunk's misplaced references, in the chunk
  for_each(chunks.size(), [&](std::size_t c) {
    const bool left = c < left_chunks;
    Chunk& chunk = chunks[c];
    chunk.begin = left ? c * kChunk : left_count + (c - left_chunks) * kChunk;
    const std::size_t end = std::min(chunk.begin + kChunk, left ? left_count : n);
    chunk.misplaced = find_misplaced(r + chunk.begin, end - chunk.begin, map, split, left, places.data() + chunk.begin,
                                     chunk.left_centroids, chunk.right_centroids);
  });
  left_centroids = right_centroids = empty_box();
  for (std::size_t c = 0; c < chunks.size(); ++c) {
    chunks[c].before = c == 0 || c == left_chunks ? 0 : chunks[c - 1].before + chunks[c - 1].misplaced;
    left_centroids = max_x86(chunks[c].left_centroids, left_centroids),
    right_centroids = max_x86(chunks[c].right_centroids, right_centroids);
  }
  for_each(left_chunks, [&](std::size_t c) {
    const Chunk& from = chunks[c];
    if (from.misplaced == 0) return;
    const Chunk* to =
        &*std::prev(std::upper_bound(chunks.begin() + std::ptrdiff_t(left_chunks), chunks.end(), from.before,
                                     [](std::size_t k, const Chunk& chunk) { return k < chunk.before; }));
    std::size_t j = from.before - to->before;
    for (std::size_t i = 0; i < from.misplaced; ++i, ++j) {
      for (; j == to->misplaced; ++to) j = 0;
      Reference &a = r[from.begin + places[from.begin + i]], &b = r[to->begin + places[to->begin + j]];
      const Box left = Box::load(&a), right = Box::load(&b);
      right.store(&a), left.store(&b);
    }
  });
}

/// The best object split of a range, and all that its partition needs: small ranges on the stack, large ones in chunks
/// for several tasks.
class ObjectSplit {
 public:
  ObjectSplit(const Reference* r, const Reference* end, const Box& centroids, unsigned max_bins, unsigned leaf_width)
      : r_(r), end_(end), map_(centroids, std::size_t(end - r), max_bins) {
    const std::size_t n = std::size_t(end - r);
    if (!map_.finite) return;
    if (n <= kLarge) {
      Bins bins;
      bin(r, end, map_, bins);
      choose(bins, leaf_width);
    } else {
      MeteredVector<ManyBins> total(1);
      bin_range(r, end, map_, total[0], chunks_);
      choose(total[0], leaf_width);
    }
  }
  /// False where all centroids fall into one bin, or some are beyond float.
  [[nodiscard]] bool exists() const { return split_.axis >= 0; }
  [[nodiscard]] float cost() const { return split_.cost; }
  [[nodiscard]] std::size_t left_count() const { return split_.left_count; }
  [[nodiscard]] const Box& left() const { return left_; }
  [[nodiscard]] const Box& right() const { return right_; }
  /// Moves the references to the two sides, in order; returns the sides' centroid bounds.
  void partition_to(Reference* left_out, Reference* right_out, Box& left_centroids, Box& right_centroids) const {
    if (chunks_.empty()) return partition(r_, end_, map_, split_, left_out, right_out, left_centroids, right_centroids);
    partition_range(r_, end_, map_, split_, chunks_, left_out, right_out, left_centroids, right_centroids);
  }
  /// The same within the range itself, of which `r` is the begin, in an order of its own. To be called once: the
  /// chunks' bins, which nothing needs any more, go.
  void partition_in_place(Reference* r, Box& left_centroids, Box& right_centroids) {
    MeteredVector<ManyBins>().swap(chunks_);
    sah::partition_in_place(r, split_.left_count, std::size_t(end_ - r_), map_, split_, left_centroids,
                            right_centroids);
  }

 private:
  template <class B>
  void choose(const B& bins, unsigned leaf_width) {
    split_ = best_split(bins, map_.bins, std::size_t(end_ - r_), leaf_width);
    if (split_.axis >= 0) child_bounds(bins, map_.bins, split_, left_, right_);
  }
  const Reference *r_, *end_;
  const BinMap map_;
  Split split_;
  Box left_, right_;
  MeteredVector<ManyBins> chunks_;
};

}  // namespace sah
}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
