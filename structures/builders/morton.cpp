// Linear BVH (Lauterbach et al., Eurographics 2009): triangles in Morton order, cut from the top where the highest differing bit
// of the codes changes; boxes on the way back. Equal codes are cut in the middle, so a million of them are 20 levels.
#include <tbb/parallel_invoke.h>

#include "core/timer.h"
#include "structures/builders/fast_builders.h"
#include "structures/builders/morton_order.h"
#include "structures/builders/node_pool.h"

namespace arboretum {
namespace {

constexpr std::size_t kParallel = 1u << 12;

class Lbvh {
 public:
  Lbvh(const TriangleMesh& mesh, const MortonOrder& order, unsigned leaf_width, BinaryTree& tree)
      : mesh_(mesh), order_(order), leaf_width_(leaf_width), tree_(tree) {}

  void build() {
    const std::size_t n = order_.size();
    tree_.nodes.resize(NodePool::capacity(n, kParallel)), tree_.first.resize(tree_.nodes.size()), tree_.primitives.resize(n);
    NodePool::Share share;
    recurse(0, n, 0, share);
    tree_.node_count = pool_.used();
  }

 private:
  Bounds3f recurse(std::size_t begin, std::size_t end, std::uint32_t index, NodePool::Share& share) {
    Bounds3f box;
    std::uint32_t left = 0;
    if (end - begin <= leaf_width_) {
      tree_.first[index] = std::uint32_t(begin);
      for (std::size_t i = begin; i < end; ++i) box.extend(mesh_.bounds(tree_.primitives[i] = order_.id(i)));
    } else {
      const std::size_t middle = order_.split(begin, end);
      left = pool_.take_pair(share);
      Bounds3f other;
      if (middle - begin > kParallel && end - middle > kParallel) {
        tbb::parallel_invoke(
            [&] {
              NodePool::Share own;
              box = recurse(begin, middle, left, own);
            },
            [&] { other = recurse(middle, end, left + 1, share); });
      } else {
        box = recurse(begin, middle, left, share);
        other = recurse(middle, end, left + 1, share);
      }
      box.extend(other);
    }
    tree_.nodes[index] = {box.lower, left, box.upper, std::uint32_t(end - begin)};
    return box;
  }

  const TriangleMesh& mesh_;
  const MortonOrder& order_;
  const unsigned leaf_width_;
  BinaryTree& tree_;
  NodePool pool_;
};

}  // namespace

void build_morton(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, BinaryTree& tree,
                  BuildReport& report) {
  check_morton_bits(parameters.morton_bits);
  if (mesh.size() == 0) return;
  double start = wall_seconds();
  const MortonOrder order(mesh, parameters.morton_bits);
  report.phases.emplace_back("order", wall_seconds() - start);
  start = wall_seconds();
  Lbvh(mesh, order, leaf_width, tree).build();
  report.phases.emplace_back("tree", wall_seconds() - start);
}

}  // namespace arboretum
