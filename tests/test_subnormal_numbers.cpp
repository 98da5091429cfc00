// Subnormal numbers: where one is multiplied, Intel's cores take some 150 cycles. So a kernel that reckons with them
// may look well on another machine and be several times slower there, with right answers on both: the processor's own
// flags tell.
#include <immintrin.h>

#include "tests/catch.h"
#include "tests/kernel_runner.h"
#include "tests/kernel_scenes.h"

using namespace arboretum;
using namespace arboretum::test;

namespace {

/// Of MXCSR: an operand was subnormal; a result was, or was less, and has been rounded.
constexpr unsigned kOperand = 1u << 1, kResult = 1u << 4;

template <class Run>
unsigned flags_of(const Run& run) {
  _mm_setcsr(_mm_getcsr() & ~(kOperand | kResult));
  run();
  return _mm_getcsr() & (kOperand | kResult);
}

/// What runnable_rows() has, and `exact` in every mode.
std::vector<KernelRow> rows() {
  std::vector<KernelRow> rows = runnable_rows();
  for (const KernelRow& row : kernel_table())
    if (is_available(row.isa) && row.intersector == "exact" && row.structure == "bvh8" && row.isa != Isa::scalar)
      rows.push_back(row);
  return rows;
}

}  // namespace

TEST_CASE("the flags tell of subnormal numbers") {
  volatile float least = 0x1p-140f, half = 0.5f, small = 0x1p-120f;
  CHECK(flags_of([&] { (void)(half * half); }) == 0);
  CHECK(flags_of([&] { half = 0.5f + 0.0f * least; }) == kOperand);
  CHECK(flags_of([&] { half = small * small; }) == kResult);
}

TEST_CASE("kernels bring in no subnormal numbers") {
  const TriangleMesh mesh = random_triangles(600, 0.1f, 3);
  std::vector<Ray> rays = aimed_rays(mesh, mesh.bounds().center() + mesh.bounds().extent() * 2.0f, 96, 61);
  const std::vector<Ray> generic = generic_rays(mesh, 96, 62);
  rays.insert(rays.end(), generic.begin(), generic.end());
  for (std::size_t i = 0; i < rays.size(); i += 3)
    rays[i].tfar = std::min(rays[i].tfar, std::numeric_limits<float>::max());
  Structures structures(mesh);
  std::size_t looked_at = 0;
  for (const KernelRow& row : rows()) {
    // What is inside Embree is its own.
    if (row.structure == "embree") continue;
    INFO(name_of(row));
    const Accel& accel = structures.get(row);
    // Of a BVH, rays in flight, which `auto` may take, order what waits as doubles of a distance and a reference, which
    // for a distance of 0 are subnormal: minima and maxima of such numbers take no longer than others.
    if (!(row.structure.starts_with("bvh") && (row.traversal.starts_with("queued") || row.traversal == "auto")))
      CHECK(flags_of([&] { (void)closest_hit(row, accel, rays); }) == 0);
    CHECK(flags_of([&] { (void)any_hit(row, accel, rays); }) == 0);
    ++looked_at;
  }
  CHECK(looked_at > 100);
}
