// Binned SAH builder (Wald, "On fast construction of SAH-based bounding volume hierarchies", RT 2007): top down, all
// three axes binned in one pass over the references, the cheapest plane taken.
//
// Partition is out of place, stable and branchless, and gathers the children's centroid bounds on its way. The work is cut
// into chunks whose size does not depend on the number of threads: the tree is the same for any number of threads.
//
// Two buffers of all references are needed for the upper levels alone. Ranges that one task builds are set aside until those are done; then the
// second buffer goes, before most nodes are made, and each task has a small one of its own, which the caches hold.
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
    PhaseClock phase(report);
    references_[0].resize(n), references_[1].resize(n);
    const sah::Bounds bounds = sah::make_references(mesh_, references_[0].data());
    phase.ends("references");
    sah::TreeWriter writer(tree_, n, references_[0].data());
    writer_ = &writer;
    {
      sah::TreeWriter::Pool pool;
      upper_levels({0, n, 0, bounds}, 0, pool);
    }
    MeteredVector<sah::Reference>().swap(references_[1]);  // an assignment would keep the memory
    struct Workspace {
      sah::TreeWriter::Pool pool;
      MeteredVector<sah::Reference> references;
    };
    tbb::enumerable_thread_specific<Workspace> workspaces([n] { return Workspace{{}, MeteredVector<sah::Reference>(std::min(n, sah::kParallel))}; });
    tbb::parallel_for(std::size_t{0}, set_aside_.size(), [&](std::size_t i) {
      const auto& [range, node] = set_aside_[i];
      Workspace& mine = workspaces.local();
      const Buffers buffers{{references_[0].data() + range.begin, mine.references.data()}, range.begin};
      recurse(buffers, {0, range.size(), 0, range.bounds}, node, mine.pool);
    });
    tree_.primitives.resize(n);
    writer.finish();
    phase.ends("splits");
  }

 private:
  /// References [begin, end) of buffer `side`.
  struct Range {
    std::size_t begin, end;
    int side;
    sah::Bounds bounds;
    std::size_t size() const { return end - begin; }
  };
  struct Subtree {
    Range range;
    std::uint32_t node;
  };
  /// Both hold a range of all references, which begins with the `first`.
  struct Buffers {
    sah::Reference* side[2];
    std::size_t first;
  };

  /// Splits a range whose centroids coincide in the middle of its order.
  static void split_in_the_middle(const Buffers& buffers, const Range& range, Range& left, Range& right) {
    const std::size_t middle = range.begin + range.size() / 2;
    left = {range.begin, middle, range.side, sah::Bounds::none()}, right = {middle, range.end, range.side, sah::Bounds::none()};
    for (Range* half : {&left, &right}) {
      for (std::size_t i = half->begin; i < half->end; ++i) half->bounds.extend(buffers.side[range.side][i]);
    }
  }

  /// Not inlined: recurse() has to do without room for bins in its frame.
  __attribute__((noinline)) void split(const Buffers& buffers, const Range& range, Range& left, Range& right) const {
    const sah::Reference* r = buffers.side[range.side];
    const sah::ObjectSplit object(r + range.begin, r + range.end, range.bounds.centroids, max_bins_, leaf_width_);
    if (!object.exists()) return split_in_the_middle(buffers, range, left, right);
    const std::size_t middle = range.begin + object.left_count();
    left = {range.begin, middle, 1 - range.side, {object.left(), {}}}, right = {middle, range.end, 1 - range.side, {object.right(), {}}};
    sah::Reference* out = buffers.side[1 - range.side];
    object.partition_to(out + left.begin, out + right.begin, left.bounds.centroids, right.bounds.centroids);
  }

  /// Splits down to ranges that one task builds, and sets those aside in the first buffer.
  void upper_levels(const Range& range, std::uint32_t index, sah::TreeWriter::Pool& pool) {
    if (range.size() <= sah::kParallel) {
      if (range.side == 1) std::copy_n(references_[1].data() + range.begin, range.size(), references_[0].data() + range.begin);
      const std::lock_guard lock(mutex_);
      set_aside_.push_back({{range.begin, range.end, 0, range.bounds}, index});
      return;
    }
    Range left, right;
    split({{references_[0].data(), references_[1].data()}, 0}, range, left, right);
    const std::uint32_t first = writer_->take_pair(pool);
    writer_->node(index, range.bounds.boxes, range.size(), first);
    if (left.size() > sah::kParallel && right.size() > sah::kParallel) {
      tbb::parallel_invoke(
          [&] {
            sah::TreeWriter::Pool own;
            upper_levels(left, first, own);
          },
          [&] { upper_levels(right, first + 1, pool); });
    } else {
      upper_levels(left, first, pool);
      upper_levels(right, first + 1, pool);
    }
  }

  void recurse(const Buffers& buffers, const Range& range, std::uint32_t index, sah::TreeWriter::Pool& pool) {
    if (range.size() <= leaf_width_) {
      const sah::Reference* r = buffers.side[range.side];
      return writer_->leaf(index, range.bounds.boxes, r + range.begin, r + range.end, buffers.first + range.begin);
    }
    Range left, right;
    split(buffers, range, left, right);
    const std::uint32_t first = writer_->take_pair(pool);
    writer_->node(index, range.bounds.boxes, range.size(), first);
    recurse(buffers, left, first, pool);
    recurse(buffers, right, first + 1, pool);
  }

  const TriangleMesh& mesh_;
  const unsigned max_bins_;
  const unsigned leaf_width_;
  BinaryTree& tree_;
  sah::TreeWriter* writer_ = nullptr;
  MeteredVector<sah::Reference> references_[2];
  std::mutex mutex_;
  MeteredVector<Subtree> set_aside_;
};

inline void build_binned_sah(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, BinaryTree& tree, BuildReport& report) {
  BinnedSah(mesh, parameters, leaf_width, tree).build(report);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
