// Spatial split SAH builder, SBVH (Stich, Friedrich, Dietrich, "Spatial Splits in Bounding Volume Hierarchies", HPG
// 2009): the binned SAH builder, but where the children of the best object split overlap, references may be split by a
// plane instead. When that pays is decided otherwise than in the paper: split_space() says how.
//
// Every range of references has room behind it, the budget of references that its splits may add; a split shares what
// it leaves of it between the children by their numbers. So the budget is kept without a counter that tasks would race
// for, and the tree is the same for any number of threads. Unlike the paper, a reference that lies on both sides is
// given to one side alone (unsplitting) by costs that do not depend on the references before it.
#pragma once

#include "structures/builders/object_split.h"
#include "structures/builders/spatial_partition.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

class SpatialSah {
 public:
  SpatialSah(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width, BinaryTree& tree)
      : mesh_(mesh), parameters_(parameters), leaf_width_(leaf_width), tree_(tree) {}

  void build(BuildReport& report) {
    const std::size_t n = mesh_.size(), room = n + std::size_t(double(n) * double(parameters_.duplication_budget));
    PhaseClock phase(report);
    references_[0].reserve(room), references_[1].reserve(room);
    references_[0].hand_out(room), references_[1].hand_out(room);
    const sah::Bounds bounds = sah::make_references(mesh_, references_[0].data());
    root_area_ = sah::half_area_or_0(bounds.boxes);
    phase.ends("references");
    sah::TreeWriter writer(tree_, room);
    writer_ = &writer;
    sah::TreeWriter::Share share;
    const std::size_t used = recurse({0, n, 0, room, 0, bounds}, 0, share);
    writer.finish();
    references_[1].clear();
    tree_.primitives.resize(used), tree_.duplicates = used > n;
    line_up(0, 0);
    phase.ends("splits");
  }

 private:
  /// References [begin, end) of buffer `side`, which may use [room_begin, room_end) of both buffers.
  struct Range {
    std::size_t begin, end, room_begin, room_end;
    int side;
    sah::Bounds bounds;
    std::size_t size() const { return end - begin; }
    std::size_t room() const { return room_end - room_begin; }
  };

  /// A split that would add fewer references is left to object splits, which take a few large ones apart from the rest.
  static constexpr std::size_t kFewest = 32;
  static constexpr float kReferenceCost = 2.0f;  ///< a reference's box: its leaf and the nodes around it
  /// Total box area of one level of a tree, as a share of the root's; typical of surfaces.
  static constexpr float kLevelCost = 0.8f;
  /// A spatial split is tried only if the references' boxes make up at least this share of the estimate.
  static constexpr float kLeastShare = 0.2f;
  /// A spatial split is rejected if its SAH cost is not below this multiple of the object split's.
  static constexpr float kMostCost = 1.25f;

  /// Where the left child's room ends when the children have so many references.
  static std::size_t divide(const Range& range, std::size_t left, std::size_t right) {
    const std::size_t free = range.room() - left - right;
    return range.room_begin + left + std::size_t(double(free) * (double(left) / double(left + right)));
  }

  /// Splits a range whose centroids coincide in the middle of its order.
  void split_in_the_middle(const Range& range, Range& left, Range& right) {
    const std::size_t half = range.size() / 2, middle = divide(range, half, range.size() - half);
    left = {range.room_begin, range.room_begin + half, range.room_begin, middle, 1 - range.side, sah::Bounds::none()};
    right = {middle, middle + range.size() - half, middle, range.room_end, 1 - range.side, sah::Bounds::none()};
    const sah::Reference* r = references_[range.side].data() + range.begin;
    sah::Reference* out = references_[1 - range.side].data();
    for (Range* child : {&left, &right}) {
      for (std::size_t i = child->begin; i < child->end; ++i, ++r) out[i] = *r, child->bounds.extend(*r);
    }
  }

  /// Not inlined: recurse() has to do without room for bins in its frame.
  __attribute__((noinline)) void split(const Range& range, Range& left, Range& right) {
    const sah::Reference* begin = references_[range.side].data() + range.begin;
    const sah::Reference* end = begin + range.size();
    const sah::ObjectSplit object(begin, end, range.bounds.centroids, parameters_.bins, leaf_width_);
    const sah::Box left_box = object.exists() ? object.left() : range.bounds.boxes,
                   right_box = object.exists() ? object.right() : range.bounds.boxes;
    if (range.room() >= range.size() + kFewest && range.size() > kFewest &&
        sah::half_area_or_0(min_x86(left_box, right_box)) > parameters_.spatial_overlap * root_area_ &&
        split_space(range, object.cost(), left, right)) {
      return;
    }
    if (!object.exists()) return split_in_the_middle(range, left, right);
    const std::size_t right_count = range.size() - object.left_count(),
                      middle = divide(range, object.left_count(), right_count);
    left = {range.room_begin,    range.room_begin + object.left_count(), range.room_begin, middle, 1 - range.side,
            {left_box, left_box}};
    right = {middle, middle + right_count, middle, range.room_end, 1 - range.side, {right_box, right_box}};
    sah::Reference* out = references_[1 - range.side].data();
    object.partition_to(out + left.begin, out + right.begin, left.bounds.centroids, right.bounds.centroids);
  }

  /// Splits by a plane in space where that pays; false where it does not.
  ///
  /// SAH takes a child for a leaf, area times references. That is far from what the subtree will cost, and chooses
  /// splits that make some trees worse. The estimate here has two parts: the boxes of the references themselves, which
  /// no object split makes smaller, and a share of the node's box for each level below. A spatial split pays by the
  /// area that it cuts off references: a share x of references more must lower the estimate by (1 - spatial_gain) x.
  /// Where the first part is small nothing is tried.
  bool split_space(const Range& range, float object_cost, Range& left, Range& right) {
    const sah::Reference* begin = references_[range.side].data() + range.begin;
    const sah::Reference* end = begin + range.size();
    float sum = 0.0f, largest = 0.0f;
    for (const sah::Reference* r = begin; r < end; ++r) {
      const float area = sah::half_area_or_0(sah::Box::load(r));
      sum += area, largest = std::max(largest, area);
    }
    const float n = float(range.size()), per_block = 1.0f / float(leaf_width_);
    const float of_references = kReferenceCost * sum * per_block;
    const float cost =
        of_references + kLevelCost * sah::half_area_or_0(range.bounds.boxes) * std::log2(n * per_block + 1.0f);
    const float least = parameters_.spatial_overlap * root_area_;  // that a reference more must save
    if (largest * 0.5f * kReferenceCost * per_block < least || of_references < kLeastShare * cost) return false;
    sah::SpatialSplit best;
    const sah::SpatialMap map(range.bounds.boxes, range.size());
    {
      sah::SpatialBins bins;
      sah::bin_range(mesh_, begin, end, map, bins);
      best = sah::best_split(bins, map.bins, range.size(), range.room(), leaf_width_);
    }
    if (best.axis < 0 || !(best.cost < kMostCost * object_cost)) return false;
    if (best.left_count + best.right_count < range.size() + kFewest) return false;
    const float added = float(best.left_count + best.right_count - range.size()),
                gain = best.saved * kReferenceCost * per_block;
    if (!(gain >= added * std::max(least, (1.0f - parameters_.spatial_gain) * cost / n))) return false;
    sah::Reference* out = references_[1 - range.side].data();
    const sah::Sides sides =
        sah::spatial_partition_range(mesh_, begin, end, map, best, out + range.room_begin, out + range.room_end);
    if (sides.left_count == 0 || sides.right_count == 0) return false;
    const std::size_t middle = divide(range, sides.left_count, sides.right_count);
    left = {range.room_begin, range.room_begin + sides.left_count, range.room_begin, middle, 1 - range.side,
            sides.left};
    right = {range.room_end - sides.right_count, range.room_end, middle, range.room_end, 1 - range.side, sides.right};
    return true;
  }

  /// Returns the number of references in the subtree's leaves.
  std::size_t recurse(const Range& range, std::uint32_t index, sah::TreeWriter::Share& share) {
    if (range.size() <= leaf_width_) {
      const sah::Reference* r = references_[range.side].data();
      writer_->leaf(index, range.bounds.boxes, r + range.begin, r + range.end, range.room_begin,
                    references_[0].data() + range.room_begin);
      return range.size();
    }
    Range left, right;
    split(range, left, right);
    const std::uint32_t first = writer_->take_pair(share);
    std::size_t left_count = 0, right_count = 0;
    if (left.size() > kOneTask && right.size() > kOneTask) {
      tbb::parallel_invoke(
          [&] {
            sah::TreeWriter::Share own;
            left_count = recurse(left, first, own);
          },
          [&] { right_count = recurse(right, first + 1, share); });
    } else {
      left_count = recurse(left, first, share);
      right_count = recurse(right, first + 1, share);
    }
    writer_->node(index, range.bounds.boxes, left_count + right_count, first);
    return left_count + right_count;
  }

  /// Brings the leaves' ids from where their references began in the first buffer into the tree's primitives, from
  /// `begin` on.
  void line_up(std::uint32_t index, std::uint32_t begin) {
    const BinaryNode& node = tree_.nodes[index];
    if (node.is_leaf()) {
      if (node.count > 0)
        std::memcpy(tree_.primitives.data() + begin, references_[0].data() + tree_.first[index],
                    node.count * sizeof(std::uint32_t));
      tree_.first[index] = begin;
      return;
    }
    const std::uint32_t right = begin + tree_.nodes[node.left].count;
    if (node.count > kOneTask) {
      tbb::parallel_invoke([&] { line_up(node.left, begin); }, [&] { line_up(node.left + 1, right); });
    } else {
      line_up(node.left, begin), line_up(node.left + 1, right);
    }
  }

  const TriangleMesh& mesh_;
  const BuilderParameters& parameters_;
  const unsigned leaf_width_;
  BinaryTree& tree_;
  float root_area_ = 0.0f;
  sah::TreeWriter* writer_ = nullptr;
  ReservedArray<sah::Reference> references_[2];
};

inline void build_spatial_sah(const TriangleMesh& mesh, const BuilderParameters& parameters, unsigned leaf_width,
                              BinaryTree& tree, BuildReport& report) {
  SpatialSah(mesh, parameters, leaf_width, tree).build(report);
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
