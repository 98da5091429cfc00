// Linear BVH (Lauterbach et al., Eurographics 2009): triangles in Morton order, cut from the top where the highest
// differing bit of the codes changes; boxes on the way back. Equal codes are cut in the middle, so a million of them
// are 20 levels.
//
// Unlike in the paper a range that a few leaf blocks hold is cut only where those are not made more, so that leaves are
// full.
#include <algorithm>

#include <tbb/parallel_invoke.h>

#include "structures/builders/box4.h"
#include "structures/builders/portable_builders.h"
#include "structures/builders/morton_order.h"
#include "structures/builders/node_pool.h"
#include "structures/builders/one_task.h"
#include "structures/builders/phase_clock.h"

namespace arboretum {
namespace {

constexpr std::size_t kFewBlocks = 3;     ///< ranges of so many leaf blocks are cut where they fill no more
constexpr std::size_t kSmall = 1u << 17;  ///< so many triangles are sorted by 21 bits of their codes at first, in two
                                          ///< passes; more by 30 bits, in three

class Lbvh {
 public:
  Lbvh(const TriangleMesh& mesh, MortonOrder& order, unsigned leaf_width, BinaryTree& tree)
      : boxes_(mesh), order_(order), leaf_width_(leaf_width), tree_(tree), pool_(tree, order.size(), kOneTask) {}

  void build() {
    const std::size_t n = order_.size();
    tree_.primitives.resize(n);
    NodePool::Share share;
    recurse(0, n, n - 1, 0, order_.sorted_bits(), share);
    pool_.finish();
  }

 private:
  Box4 leaf(std::size_t begin, std::size_t end, std::size_t last) noexcept {
    boxes_.prefetch([&](std::size_t i) { return order_.id(i); }, begin, end, last);
    Box4 box;
    for (std::size_t i = begin; i < end; ++i) box.extend(boxes_.box(tree_.primitives[i] = order_.id(i)));
    return box;
  }

  std::size_t split(std::size_t begin, std::size_t end) const noexcept {
    return end - begin <= kFewBlocks * leaf_width_ ? order_.split_into_blocks(begin, end, leaf_width_)
                                                   : order_.split(begin, end);
  }

  /// [begin, end) is sorted by the first `sorted` bits of the codes; the task that calls goes on up to `last`.
  Box4 recurse(std::size_t begin, std::size_t end, std::size_t last, std::uint32_t index, unsigned sorted,
               NodePool::Share& share) {
    Box4 box;
    std::uint32_t left = 0;
    if (end - begin <= leaf_width_) {
      tree_.first[index] = std::uint32_t(begin);
      box = leaf(begin, end, last);
    } else {
      while (order_.refinable(begin, end, sorted)) sorted = order_.refine(begin, end, sorted);
      const std::size_t middle = split(begin, end);
      left = pool_.take_pair(share);
      Box4 other;
      if (middle - begin > kOneTask && end - middle > kOneTask) {
        tbb::parallel_invoke(
            [&] {
              NodePool::Share own;
              box = recurse(begin, middle, middle - 1, left, sorted, own);
            },
            [&] { other = recurse(middle, end, last, left + 1, sorted, share); });
      } else {
        box = recurse(begin, middle, last, left, sorted, share);
        other = recurse(middle, end, last, left + 1, sorted, share);
      }
      box.extend(other);
    }
    tree_.nodes[index] = {to_vec3f(box.lower), left, to_vec3f(box.upper), std::uint32_t(end - begin)};
    return box;
  }

  const TriangleBoxes boxes_;
  MortonOrder& order_;
  const unsigned leaf_width_;
  BinaryTree& tree_;
  NodePool pool_;
};

}  // namespace

void build_morton(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, BinaryTree& tree,
                  BuildReport& report) {
  check_morton_bits(parameters.morton_bits);
  if (mesh.size() == 0) return;
  PhaseClock phase(report);
  MortonOrder order(mesh, parameters.morton_bits, mesh.size() <= kSmall ? 21 : MortonOrder::kAtOnce);
  phase.ends("order");
  Lbvh(mesh, order, leaf_width, tree).build();
  phase.ends("tree");
}

}  // namespace arboretum
