// The kernels of sorted_boxes, written once and compiled for each instruction set. A ray tests all boxes, eight at a
// time, sorts those that it meets by where it enters them, and tests their blocks in that order: until the next box
// begins beyond the nearest hit, or until anything is hit.
#pragma once

#include "traversal/box_test.h"
#include "traversal/kernel_rows.h"
#include "traversal/single_rays.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

/// A box that the ray meets as one number: the bits of where it enters, then the block. Bits of floats from +0 on order
/// as integers, so these sort from near to far.
using MetBox = std::uint64_t;

[[nodiscard]] ARBORETUM_INLINE MetBox met_box(float entry, std::size_t block) {
  return std::uint64_t(__builtin_bit_cast(std::uint32_t, entry + 0.0f)) << 32 | block;  // -0 becomes +0
}
[[nodiscard]] ARBORETUM_INLINE float entry_of(MetBox box) {
  return __builtin_bit_cast(float, std::uint32_t(box >> 32));
}

/// The three functions below, a class and one call are all that a structure needs: every leaf and intersector then goes
/// with it.
template <class Leaves, bool Padded, class Counting>
class SortedBoxesKernel {
 public:
  SortedBoxesKernel(const Accel& accel, const KernelRow& row, Counting counting)
      : accel_(static_cast<const sorted_boxes::SortedBoxes&>(accel)), leaves_(row, accel_.vertices()),
        form_(*row.tests->form), counting_(counting) {}

  /// Any hit: whether there is one. Closest hit: updates `best`.
  template <bool AnyHit>
  bool trace(const Ray& ray, float /*time*/, NearestHit& best) {
    typename Leaves::RayData data = leaves_.prepare(ray);
    find_boxes(ray);
    for (MetBox box : met_) {
      if (entry_of(box) > best.t) break;  // a box at an equal distance may hold the hit of a lower id
      const std::byte* block = accel_.block_bytes() + std::uint32_t(box) * leaves_.block_bytes();
      counting_.leaf(form_, block, 1);
      if constexpr (AnyHit) {
        if (leaves_.any_hit(data, block, 1, ray.tnear, ray.tfar)) return true;
      } else {
        leaves_.closest_hit(data, block, 1, ray.tnear, best);
      }
    }
    if constexpr (!AnyHit) leaves_.finish(data, best);
    return false;
  }

 private:
  /// Every box that the ray meets, from near to far.
  void find_boxes(const Ray& ray) {
    constexpr int W = sorted_boxes::BoxGroup::kWidth;
    const BoxLanes<W, Padded> boxes(BoxRay<W, Padded>(ray, accel_.max_coordinate()));
    const vf<W> tnear(ray.tnear), tfar(ray.tfar);
    met_.clear();
    for (std::size_t group = 0; group < accel_.groups(); ++group) {
      vf<W> entry;
      unsigned hit = boxes.test(reinterpret_cast<const std::byte*>(accel_.boxes() + group), tnear, tfar, entry);
      counting_.node(unsigned(std::min<std::size_t>(W, accel_.blocks() - group * W)), W,
                     unsigned(__builtin_popcount(hit)));
      alignas(64) float entries[W];
      entry.store(entries);
      for (; hit != 0; hit &= hit - 1) {
        const unsigned i = unsigned(__builtin_ctz(hit));
        met_.push_back(met_box(entries[i], group * W + i));
      }
    }
    std::sort(met_.begin(), met_.end());
  }

  const sorted_boxes::SortedBoxes& accel_;
  Leaves leaves_;
  const LeafForm& form_;
  Counting counting_;
  std::vector<MetBox> met_;  ///< as long as it must be; one for the whole batch
};

inline void add_kernels(std::type_identity<sorted_boxes::SortedBoxes>, KernelRows& rows) {
  add_rows<sorted_boxes::SortedBoxes, SingleRayFunctions<SortedBoxesKernel>>(rows, "single", TypeList<>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
