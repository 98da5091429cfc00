// Binned SAH builder (Wald, "On fast construction of SAH-based bounding volume hierarchies", RT 2007): top down, all
// three axes binned in one pass over the references, the cheapest plane taken.
//
// Partition is out of place, stable and branchless, and gathers the children's centroid bounds on its way. The work is cut
// into chunks whose size does not depend on the number of threads: the tree is the same for any number of threads.
#pragma once

#include "structures/builders/object_split.h"
#include "structures/builders/sah_references.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

class BinnedSah {
 public:
  BinnedSah(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, BinaryTree& tree)
      : mesh_(mesh), max_bins_(parameters.bins), leaf_width_(leaf_width), tree_(tree) {}

  void build(BuildReport& report) {
    const std::size_t n = mesh_.size();
    double start = wall_seconds();
    const auto phase = [&](const char* name) {
      const double now = wall_seconds();
      report.phases.emplace_back(name, now - start);
      start = now;
    };
    references_[0].resize(n), references_[1].resize(n);
    const sah::Bounds bounds = sah::make_references(mesh_, references_[0].data());
    phase("references");
    sah::TreeWriter writer(tree_, n, references_[0].data());
    writer_ = &writer;
    sah::TreeWriter::Pool pool;
    recurse({0, n, 0, bounds}, 0, pool);
    references_[1] = {};
    tree_.primitives.resize(n);
    writer.finish();
    phase("splits");
  }

 private:
  /// References [begin, end) of buffer `side`.
  struct Range {
    std::size_t begin, end;
    int side;
    sah::Bounds bounds;
    std::size_t size() const { return end - begin; }
  };

  /// Splits a range whose centroids coincide in the middle of its order.
  void split_in_the_middle(const Range& range, Range& left, Range& right) const {
    const std::size_t middle = range.begin + range.size() / 2;
    left = {range.begin, middle, range.side, sah::Bounds::none()}, right = {middle, range.end, range.side, sah::Bounds::none()};
    for (Range* half : {&left, &right}) {
      for (std::size_t i = half->begin; i < half->end; ++i) half->bounds.extend(references_[range.side][i]);
    }
  }

  /// Not inlined: recurse() has to do without room for bins in its frame.
  __attribute__((noinline)) void split(const Range& range, Range& left, Range& right) {
    const sah::Reference* r = references_[range.side].data();
    const sah::ObjectSplit object(r + range.begin, r + range.end, range.bounds.centroids, max_bins_, leaf_width_);
    if (!object.exists()) return split_in_the_middle(range, left, right);
    const std::size_t middle = range.begin + object.left_count();
    left = {range.begin, middle, 1 - range.side, {object.left(), {}}}, right = {middle, range.end, 1 - range.side, {object.right(), {}}};
    sah::Reference* out = references_[1 - range.side].data();
    object.partition_to(out + left.begin, out + right.begin, left.bounds.centroids, right.bounds.centroids);
  }

  void recurse(const Range& range, std::uint32_t index, sah::TreeWriter::Pool& pool) {
    if (range.size() <= leaf_width_) {
      const sah::Reference* r = references_[range.side].data();
      return writer_->leaf(index, range.bounds.boxes, r + range.begin, r + range.end, range.begin);
    }
    Range left, right;
    split(range, left, right);
    const std::uint32_t first = writer_->take_pair(pool);
    writer_->node(index, range.bounds.boxes, range.size(), first);
    if (left.size() > sah::kParallel && right.size() > sah::kParallel) {
      tbb::parallel_invoke(
          [&] {
            sah::TreeWriter::Pool own;
            recurse(left, first, own);
          },
          [&] { recurse(right, first + 1, pool); });
    } else {
      recurse(left, first, pool);
      recurse(right, first + 1, pool);
    }
  }

  const TriangleMesh& mesh_;
  const unsigned max_bins_;
  const unsigned leaf_width_;
  BinaryTree& tree_;
  sah::TreeWriter* writer_ = nullptr;
  MeteredVector<sah::Reference> references_[2];
};

inline void build_binned_sah(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, BinaryTree& tree, BuildReport& report) {
  BinnedSah(mesh, parameters, leaf_width, tree).build(report);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
