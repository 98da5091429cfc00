// Binned SAH builder (Wald, "On fast construction of SAH-based bounding volume hierarchies", RT 2007): top down, all
// three axes binned in one pass over the references, the cheapest plane taken.
//
// The work is cut into chunks whose size does not depend on the number of threads: the tree is the same for any number
// of threads.
//
// The upper levels are partitioned in place. Ranges that one task builds are set aside until those are done; then each
// is built with a small second buffer, which the caches hold, and the memory of its references is given back.
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
    references_.reserve(n), references_.hand_out(n);
    const sah::Bounds bounds = sah::make_references(mesh_, references_.data());
    phase.ends("references");
    sah::TreeWriter writer(tree_, n);
    writer_ = &writer;
    {
      sah::TreeWriter::Share share;
      upper_levels({references_.data(), n, bounds}, 0, share);
    }
    struct Workspace {
      sah::TreeWriter::Share share;
      MeteredVector<sah::Reference> references;
    };
    // By the place that a thread has in the arena: there may be more threads in the course of time, but no two at once
    // have the same one.
    std::vector<Workspace> workspaces(static_cast<std::size_t>(tbb::this_task_arena::max_concurrency()));
    const auto begin_of = [this](const Subtree& subtree) {
      return std::size_t(subtree.range.references - references_.data());
    };
    tbb::parallel_for(std::size_t{0}, set_aside_.size(), [&](std::size_t i) {
      const auto& [range, node] = set_aside_[i];
      Workspace& mine = workspaces[std::size_t(tbb::this_task_arena::current_thread_index())];
      if (mine.references.empty()) mine.references.resize(std::min(n, std::size_t{kOneTask}));
      const std::size_t begin = begin_of(set_aside_[i]), id_bytes = range.size * sizeof(std::uint32_t);
      recurse(range, mine.references.data(), {begin, reinterpret_cast<std::byte*>(range.references)}, node, mine.share);
      references_.give_back(begin + (id_bytes + sizeof(sah::Reference) - 1) / sizeof(sah::Reference),
                            begin + range.size);
    });
    writer.finish();
    tree_.primitives.resize(n);
    tbb::parallel_for(std::size_t{0}, set_aside_.size(), [&](std::size_t i) {
      const Range& range = set_aside_[i].range;
      if (range.size > 0)
        std::memcpy(tree_.primitives.data() + begin_of(set_aside_[i]), range.references,
                    range.size * sizeof(std::uint32_t));
    });
    phase.ends("splits");
  }

 private:
  struct Range {
    sah::Reference* references;
    std::size_t size;
    sah::Bounds bounds;
  };
  struct Subtree {
    Range range;
    std::uint32_t node;
  };
  /// Where a range's leaves stand among the tree's primitives, and where their ids are kept until the references are
  /// gone: at the beginning of the references that one task builds from, where leaves that are done have left room.
  struct Leaves {
    std::size_t first;
    std::byte* ids;
    [[nodiscard]] Leaves behind(std::size_t n) const { return {first + n, ids + n * sizeof(std::uint32_t)}; }
  };

  /// Splits a range whose centroids coincide in the middle of its order.
  static void split_in_the_middle(const Range& range, Range& left, Range& right) {
    const std::size_t half = range.size / 2;
    left = {range.references, half, sah::Bounds::none()},
    right = {range.references + half, range.size - half, sah::Bounds::none()};
    for (Range* side : {&left, &right})
      for (std::size_t i = 0; i < side->size; ++i) side->bounds.extend(side->references[i]);
  }

  /// Splits a range: into as much room in `other`, or in place where that is nullptr. Returns true where the sides are
  /// in `other`. Not inlined: recurse() has to do without room for bins in its frame.
  __attribute__((noinline)) bool split(const Range& range, sah::Reference* other, Range& left, Range& right) const {
    sah::ObjectSplit object(range.references, range.references + range.size, range.bounds.centroids, max_bins_,
                            leaf_width_);
    if (!object.exists()) {
      split_in_the_middle(range, left, right);
      return false;
    }
    sah::Reference* const out = other ? other : range.references;
    left = {out, object.left_count(), {object.left(), {}}},
    right = {out + left.size, range.size - left.size, {object.right(), {}}};
    if (other) {
      object.partition_to(left.references, right.references, left.bounds.centroids, right.bounds.centroids);
    } else {
      object.partition_in_place(out, left.bounds.centroids, right.bounds.centroids);
    }
    return other != nullptr;
  }

  /// Splits down to ranges that one task builds, and sets those aside.
  void upper_levels(const Range& range, std::uint32_t index, sah::TreeWriter::Share& share) {
    if (range.size <= kOneTask) {
      const std::lock_guard lock(mutex_);
      set_aside_.push_back({range, index});
      return;
    }
    Range left, right;
    split(range, nullptr, left, right);
    const std::uint32_t first = writer_->take_pair(share);
    writer_->node(index, range.bounds.boxes, range.size, first);
    if (left.size > kOneTask && right.size > kOneTask) {
      tbb::parallel_invoke(
          [&] {
            sah::TreeWriter::Share own;
            upper_levels(left, first, own);
          },
          [&] { upper_levels(right, first + 1, share); });
    } else {
      upper_levels(left, first, share);
      upper_levels(right, first + 1, share);
    }
  }

  /// `other` has room for as many references.
  void recurse(const Range& range, sah::Reference* other, const Leaves& leaves, std::uint32_t index,
               sah::TreeWriter::Share& share) {
    if (range.size <= leaf_width_) {
      return writer_->leaf(index, range.bounds.boxes, range.references, range.references + range.size, leaves.first,
                           leaves.ids);
    }
    Range left, right;
    sah::Reference* const free = split(range, other, left, right) ? range.references : other;
    const std::uint32_t first = writer_->take_pair(share);
    writer_->node(index, range.bounds.boxes, range.size, first);
    recurse(left, free, leaves, first, share);
    recurse(right, free + left.size, leaves.behind(left.size), first + 1, share);
  }

  const TriangleMesh& mesh_;
  const unsigned max_bins_;
  const unsigned leaf_width_;
  BinaryTree& tree_;
  sah::TreeWriter* writer_ = nullptr;
  ReservedArray<sah::Reference> references_;
  std::mutex mutex_;
  MeteredVector<Subtree> set_aside_;
};

inline void build_binned_sah(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width,
                             BinaryTree& tree, BuildReport& report) {
  BinnedSah(mesh, parameters, leaf_width, tree).build(report);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
