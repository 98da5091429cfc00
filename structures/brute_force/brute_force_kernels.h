// The kernels of brute_force: every block of the one leaf. There is no box to test, so `fast` and `padded` are the same
// function; both rows exist, so that a sweep over box tests keeps its reference column.
#pragma once

#include "traversal/kernel_rows.h"
#include "traversal/single_rays.h"

namespace arboretum {
namespace ARBORETUM_ISA_NAMESPACE {

template <class Leaves, bool, class Counting>
class BruteForceKernel {
 public:
  BruteForceKernel(const Accel& accel, const KernelRow& row, Counting counting)
      : accel_(static_cast<const brute_force::BruteForce&>(accel)), leaves_(row, accel_.vertices()),
        form_(*row.tests->form), counting_(counting) {}

  template <bool AnyHit>
  bool trace(const Ray& ray, float /*time*/, NearestHit& best) {
    const std::byte* const blocks = accel_.base();
    const unsigned count = accel_.block_count();
    if (count == 0) return false;
    typename Leaves::RayData data = leaves_.prepare(ray);
    if constexpr (AnyHit) return any_hit_in_leaf(leaves_, data, form_, counting_, blocks, count, ray.tnear, ray.tfar);
    counting_.leaf(form_, blocks, count);
    leaves_.closest_hit(data, blocks, count, ray.tnear, best);
    leaves_.finish(data, best);
    return false;
  }

 private:
  const brute_force::BruteForce& accel_;
  Leaves leaves_;
  const LeafForm& form_;
  Counting counting_;
};

inline void add_kernels(std::type_identity<brute_force::BruteForce>, KernelRows& rows) {
  add_rows<brute_force::BruteForce, SingleRayFunctions<BruteForceKernel>>(rows, "single", TypeList<>{});
}

}  // namespace ARBORETUM_ISA_NAMESPACE
}  // namespace arboretum
