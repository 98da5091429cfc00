#include "traversal/ray_order.h"

#include <algorithm>
#include <cmath>

#include <tbb/task_arena.h>

#include "core/bounds.h"
#include "core/morton.h"
#include "structures/builders/radix_sort.h"

namespace arboretum {
namespace {

constexpr unsigned kCellBits = 8, kIndexBits = 32;

std::uint32_t octant_of(Vec3f d) noexcept {
  return std::uint32_t(std::signbit(d.x)) << 2 | std::uint32_t(std::signbit(d.y)) << 1 |
         std::uint32_t(std::signbit(d.z));
}

}  // namespace

std::vector<std::uint32_t> ray_order(RayBatch rays) {
  Bounds3f origins;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    if (is_valid(rays[i])) origins.extend(rays[i].origin);
  }
  const Vec3f extent = origins.extent();
  const float largest = std::max({extent.x, extent.y, extent.z});
  const float scale = largest > 0x1p-100f ? float(1u << kCellBits) / largest : 0.0f;
  // What is not a number, as where the extent overflows, counts as 0.
  const auto cell = [&](float x, float lower) {
    const float at = (x - lower) * scale;
    return at > 0.0f ? std::uint32_t(std::min(at, float((1u << kCellBits) - 1))) : 0u;
  };
  MeteredVector<std::uint64_t> keys(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Vec3f o = rays[i].origin;
    const std::uint64_t place =
        morton_code(cell(o.x, origins.lower.x), cell(o.y, origins.lower.y), cell(o.z, origins.lower.z));
    keys[i] = (std::uint64_t(octant_of(rays[i].direction)) << 3 * kCellBits | place) << kIndexBits | i;
  }
  tbb::task_arena(1).execute([&] { radix_sort(keys, kIndexBits, kIndexBits + 3 * kCellBits + 3); });
  std::vector<std::uint32_t> order(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) order[i] = std::uint32_t(keys[i]);
  return order;
}

}  // namespace arboretum
