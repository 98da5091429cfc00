#include "structures/leaves/leaf_lists.h"

#include <algorithm>
#include <cstring>

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include "core/error.h"
#include "core/random.h"
#include "structures/archive.h"
#include "structures/leaves/block_padding.h"

namespace arboretum {
namespace {

struct Hashed {
  std::uint64_t hash;
  std::uint32_t list;
  friend bool operator<(const Hashed& a, const Hashed& b) noexcept {
    return a.hash != b.hash ? a.hash < b.hash : a.list < b.list;
  }
};

/// For every list that is not empty a lower-numbered one that is equal to it, or itself.
MeteredVector<std::uint32_t> find_equal_lists(const LeafLists& lists) {
  std::size_t filled = 0;
  for (std::size_t i = 0; i < lists.size(); ++i) filled += lists.begin[i] != lists.begin[i + 1];
  MeteredVector<Hashed> hashed(filled);
  for (std::size_t i = 0, k = 0; i < lists.size(); ++i)
    if (lists.begin[i] != lists.begin[i + 1]) hashed[k++].list = std::uint32_t(i);
  tbb::parallel_for(std::size_t(0), hashed.size(), [&](std::size_t k) {
    std::uint64_t h = 1;
    for (std::uint32_t id : lists[hashed[k].list]) h = mix64(h ^ id);
    hashed[k].hash = h;
  });
  tbb::parallel_sort(hashed.begin(), hashed.end());
  MeteredVector<std::uint32_t> same_as(lists.size());
  tbb::parallel_for(std::size_t(0), hashed.size(), [&](std::size_t k) {
    // Looks back 64 entries at most, and where lists of one hash differ compares one pair alone: sharing may
    // be lost, never an answer.
    std::size_t first = k;
    while (first > 0 && k - first < 64 && hashed[first - 1].hash == hashed[k].hash) --first;
    const std::uint32_t list = hashed[k].list, other = hashed[first].list;
    same_as[list] = std::ranges::equal(lists[list], lists[other]) ? other : list;
  });
  return same_as;
}

}  // namespace

void LeafStore::fill(const TriangleMesh& mesh, const LeafLists& lists, std::string_view leaf,
                     std::string_view structure, bool share, LeafCode* codes) {
  leaf_ = leaf, vertices_ = mesh.vertices.data();
  blocks_ = Arena(), long_leaves_.clear();
  const MeteredVector<std::uint32_t> same_as = share ? find_equal_lists(lists) : MeteredVector<std::uint32_t>();
  const auto original = [&](std::size_t i) { return share ? std::size_t(same_as[i]) : i; };
  const bool known = with_block(leaf, [&]<class Block>(std::type_identity<Block>) {
    std::uint64_t next = 0;
    for (std::size_t i = 0; i < lists.size(); ++i) {
      const std::size_t count = lists[i].size();
      if (count == 0) continue;
      if (original(i) != i) {  // a lower number: its code stands
        codes[i] = codes[original(i)];
        continue;
      }
      const std::uint64_t blocks = (count + Block::kWidth - 1) / Block::kWidth;
      if (next + blocks >= (std::uint64_t(1) << (32 - kLeafShift))) {
        throw UserError(std::string(structure) + " with " + std::string(leaf) +
                        " needs more than 2^28 leaf blocks: use wider blocks or a coarser structure");
      }
      if (blocks < kLongLeaf) {
        codes[i] = LeafCode(next) << kLeafShift | LeafCode(blocks);
      } else {
        codes[i] = LeafCode(long_leaves_.size()) << kLeafShift | kLongLeaf;
        long_leaves_.push_back({std::uint32_t(next), std::uint32_t(blocks)});
      }
      next += blocks;
    }
    blocks_ = Arena(std::max<std::size_t>(next * sizeof(Block), 64));
    std::memset(blocks_.data() + next * sizeof(Block), 0, blocks_.bytes() - next * sizeof(Block));
    auto* base = reinterpret_cast<Block*>(blocks_.data());
    tbb::parallel_for(std::size_t(0), lists.size(), [&](std::size_t i) {
      if (lists[i].empty() || original(i) != i) return;
      const LongLeaf leaf = range(codes[i]);
      fill_blocks(base + leaf.first, mesh, lists[i]);
      clear_padding(base + leaf.first, leaf.blocks);
    });
  });
  if (!known) throw UserError(std::string(structure) + " has no leaf '" + std::string(leaf) + "'");
}

void LeafStore::archive(Archive& archive) {
  archive(leaf_, blocks_, long_leaves_);
  vertices_ = archive.mesh().vertices.data();
}

}  // namespace arboretum
